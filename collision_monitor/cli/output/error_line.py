"""The line on stderr with which a command ends that could not do its work."""

from __future__ import annotations

import sys
from typing import Final

_LONGEST: Final = 2000
"""Characters of an error: a value from a hostile file that it repeats can have a million."""


def print_error(error: Exception | str) -> None:
    """Print an error, shortened in its middle if it is too long to read."""
    text = str(error)
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} [...] {text[-_LONGEST // 2 :]}"
    print(f"collision-monitor: error: {text}", file=sys.stderr)
