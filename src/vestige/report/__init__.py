"""One self-contained page for results: a campaign's store, or the folder of a threat table. A page computes nothing."""

from __future__ import annotations

from vestige.report.page import MARK, Page, is_report, write_page
from vestige.report.run_page import run_page
from vestige.report.threat_page import threat_page

__all__ = ["MARK", "Page", "is_report", "run_page", "threat_page", "write_page"]
