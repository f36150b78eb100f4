"""The browser of the report's tests, for the page of rolling bodies too."""

from tests.report.conftest import browser as browser
