"""A session as one page that people look at: verdict, timeline, predicted against actual, distances, tracks."""

from collision_monitor.report.page import write_report

__all__ = ["write_report"]
