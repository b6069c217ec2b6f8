"""Number types of command line options. A value out of range is wrong usage, exit code 2."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable


def whole(least: int, most: int | None = None) -> Callable[[str], int]:
    """Return a parser of whole numbers that are at least `least`, and at most `most`."""

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if value < least or (most is not None and value > most):
            limits = f"from {least}" if most is None else f"from {least} to {most}"
            raise argparse.ArgumentTypeError(f"expected a whole number {limits}, got {text!r}")
        return value

    return parse


def positive_number(text: str) -> float:
    """Parse a finite number above 0."""
    value = _finite(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"expected a number above 0, got {text!r}")
    return value


def not_negative(text: str) -> float:
    """Parse a finite number that is at least 0."""
    value = _finite(text)
    if not value >= 0.0:
        raise argparse.ArgumentTypeError(f"expected a number, at least 0, got {text!r}")
    return value


def _finite(text: str) -> float:
    """Parse a number. Return NaN if the text is not a finite number."""
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def size(text: str) -> int:
    """Parse a number of bytes above 0. `500M` is 500,000,000."""
    factor = {"K": 10**3, "M": 10**6, "G": 10**9}.get(text[-1:].upper(), 1)
    number = text if factor == 1 else text[:-1]
    if not (number.isdecimal() and int(number)):
        raise argparse.ArgumentTypeError(f"expected a number of bytes above 0, such as 500M or 2G, got {text!r}")
    return int(number) * factor
