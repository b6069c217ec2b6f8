"""Report of a session as one HTML page: verdict, timeline, predicted against actual, distances, tracks."""

from collision_monitor.report.page import check_report, write_report

__all__ = ["check_report", "write_report"]
