"""A file that a command writes for its user."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from collision_monitor.errors import InputError


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turns the OSError of a file that cannot be written into an InputError."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: expected a file that can be written, got: {error.strerror}") from None
