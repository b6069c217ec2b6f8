"""What a line of the sources file does, for `~/sources`, `/diagnostics` and `collision-monitor sources --check`."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class DiagnosticLevel(IntEnum):
    """The levels of DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


class LineReport(NamedTuple):
    """level: with the text that explains it. The counts are those since the start."""

    name: str
    topic: str
    type: str
    messages: int
    states: int
    refused: int
    last_refusal: str
    points_dropped: int
    level: DiagnosticLevel
    text: str
