"""How old and how far apart what a guard relies on may be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class GuardLimits:
    """Times in s. max_age: of the monitor's answers and of the robot's states. command: age of a command.

    obstacle: time without a new state of an object that the rules name. ahead: by which a stamp may be in the future.
    """

    max_age: float = 0.3
    command: float = 0.5
    obstacle: float = 1.0
    ahead: float = 0.1
