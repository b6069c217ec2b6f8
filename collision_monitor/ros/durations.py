"""Durations in words."""

from __future__ import annotations


def spoken(seconds: float) -> str:
    """Return a duration for people: 1.2 s, 3 min, 5 h, 12 days."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.1f} s"
