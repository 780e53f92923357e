"""Make self-contained HTML pages about the stored results of a campaign, or about a threat table."""

from __future__ import annotations

from vestige.report.page import MARK, Page, is_report, write_page
from vestige.report.run_page import run_page
from vestige.report.threat_page import threat_page

__all__ = ["MARK", "Page", "is_report", "run_page", "threat_page", "write_page"]
