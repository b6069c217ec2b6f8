"""The files that a command writes: their option `--force`, the checks before its work, and the errors of writing."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import combinations
from pathlib import Path
from typing import Final

from collision_monitor.cli.options.usage import UsageError
from collision_monitor.errors import InputError
from collision_monitor.session.output_file import check_output

PICTURES: Final = (".png", ".svg", ".pdf")
"""Endings of the pictures that a command draws; they choose the format."""


def add_force(parser: argparse.ArgumentParser, files: str = "existing files") -> None:
    """Add the option without which no command overwrites a file."""
    parser.add_argument("--force", action="store_true", help=f"overwrite {files}")


def check_outputs(outputs: Mapping[str, Path | None], *, force: bool, inputs: Iterable[str | Path | None] = ()) -> None:
    """Check before the work that a command may write its files. Raises UsageError, SessionError.

    outputs: path of each option, None if it was not given. inputs: what the command reads, as in `check_output`; names
    of profiles, which may be files, too.
    """
    chosen = {option: path for option, path in outputs.items() if path is not None}
    for (one, a), (other, b) in combinations(chosen.items(), 2):
        if os.path.realpath(a) == os.path.realpath(b):
            raise UsageError(f"{one}, {other}: expected two files, got {b} for both")
    read = [Path(each) for each in inputs if each]
    for path in chosen.values():
        check_output(path, overwrite=force, inputs=read)


def check_picture(option: str, path: Path | None) -> None:
    """Raise UsageError unless the picture's name has the ending of a format."""
    if path is not None and path.suffix.lower() not in PICTURES:
        raise UsageError(f"{option}: expected a name that ends in {', '.join(PICTURES)}, got {path}")


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Raise InputError in place of the OSError of a file that cannot be written."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{path}: expected a file that can be written, got: {error.strerror or error}") from None
