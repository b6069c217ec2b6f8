"""Error handling of the files that a command writes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from collision_monitor.errors import InputError


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Raise InputError in place of the OSError of a file that cannot be written."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: expected a file that can be written, got: {error.strerror}") from None
