"""The browser of the report tests, also for the page of rolling bodies."""

from tests.report.conftest import browser as browser
