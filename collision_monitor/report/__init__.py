"""A session as one page that people look at: verdict, timeline, predicted against actual, distances, tracks."""

from collision_monitor.report.page import check_outputs, write_report

__all__ = ["check_outputs", "write_report"]
