"""The report of an analysis: one self-contained HTML file."""

from linkjax.report._report import write_report as write_report
from linkjax.report._rolling import write_rolling_report as write_rolling_report
