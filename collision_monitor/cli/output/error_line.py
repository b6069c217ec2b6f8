"""The line on stderr with which a command ends that could not do its work."""

from __future__ import annotations

import sys

from collision_monitor.errors import one_line


def print_error(error: Exception | str) -> None:
    """Print an error, shortened in its middle if it is too long to read."""
    print(f"collision-monitor: error: {one_line(str(error))}", file=sys.stderr)
