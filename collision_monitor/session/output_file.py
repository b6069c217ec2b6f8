"""The rule for all files that a command writes: no input is overwritten, and no other file without being asked to."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from collision_monitor.errors import SessionError
from collision_monitor.settings.regular_file import PIPE, SOCKET, found_instead

_RECORDED: Final = (".mcap", ".db3")
"""Endings of the files of a recording, before that of a compression. Its folder may hold results too."""


def check_output(path: Path, *, overwrite: bool, inputs: Iterable[Path] = ()) -> None:
    """Raise SessionError unless the file may be written: called before the work, which can be long.

    overwrite: whether it may exist; a device such as /dev/stdout always may, also where that is a pipe, but a named
    pipe may not: nobody may ever read from it. inputs: files, and folders of recordings, that are read; they are never
    overwritten, not through a link either.
    """
    try:
        _check(path, overwrite, inputs)
    except OSError as error:
        raise SessionError(f"{path}: expected a file that can be written, got: {error.strerror}") from None


def check_recording(path: Path, *, overwrite: bool, inputs: Iterable[Path] = ()) -> None:
    """Do the same for a recording, which is a folder of files unless its name ends in `.mcap`. Raises SessionError."""
    if path.suffix == ".mcap" or not path.is_dir():
        check_output(path, overwrite=overwrite, inputs=inputs)
        return
    read = [file.resolve() for file in _files(inputs)]
    if any(file.resolve() in read for file in _files([path])):
        raise SessionError(f"{path}: expected another folder than one with a file that the command reads")
    if not overwrite:
        raise SessionError(f"{path}: expected a new folder, got one that exists; choose another name or --force")


def _check(path: Path, overwrite: bool, inputs: Iterable[Path]) -> None:
    folder = Path(os.path.realpath(path)).parent if path.is_symlink() else path.parent
    if not folder.is_dir():
        raise SessionError(f"{path}: expected a file that can be written, got no folder {folder}")
    if path.is_dir():
        raise SessionError(f"{path}: expected a file that can be written, got a folder")
    if (found := found_instead(Path(os.path.realpath(path)))) in (PIPE, SOCKET):
        raise SessionError(f"{path}: expected a file that can be written, got {found}")
    if path.exists():
        if any(path.samefile(file) for file in _files(inputs)):
            raise SessionError(f"{path}: expected another file than those that the command reads")
        if path.is_file() and not overwrite:
            raise SessionError(f"{path}: expected a new file, got one that exists; choose another name or --force")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise SessionError(f"{path}: expected a file that can be written, got no permission to write it")


def _files(inputs: Iterable[Path]) -> Iterator[Path]:
    """Yield the files of the inputs that exist."""
    for each in inputs:
        with suppress(OSError):  # the command itself reports an input that it cannot read
            if not each.is_dir():
                yield from [each] if each.exists() else []
                continue
            for file in each.iterdir():
                if file.name == "metadata.yaml" or not set(_RECORDED).isdisjoint(file.suffixes):
                    yield file
