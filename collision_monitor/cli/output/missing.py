"""The lines that say what a session lacks."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Final

_SHOWN: Final = 3


def missing_lines(problems: Sequence[str], where: str = "") -> list[str]:
    """Return a line for each of the first problems of a session. where: which one, such as ` in A`."""
    lines = [f"missing{where}: {problem}" for problem in problems[:_SHOWN]]
    return [*lines, f"missing{where}: and {len(problems) - _SHOWN} more"] if len(problems) > _SHOWN else lines


def print_missing(problems: Sequence[str]) -> None:
    """Print the lines on stderr, beside the numbers, which are those of the rest."""
    for line in missing_lines(problems):
        print(line, file=sys.stderr, flush=True)
