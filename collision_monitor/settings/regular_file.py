"""Opens the files that people, parameters and messages name. Every reader of this package uses it.

A path may lead to a named pipe, which makes an ordinary `open` wait for a writer for ever, to a device such as
/dev/zero, which has no end, or to more bytes than memory. So only regular files are opened, up to a size that the
reader states, and no read waits.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, Final

from collision_monitor.errors import CollisionMonitorError, InputError

READABLE: Final = "a file that can be read"

FOLDER: Final = "a folder"
PIPE: Final = "a named pipe"
SOCKET: Final = "a socket"
NOTHING: Final = "nothing there"
"""What `found_instead` returns for a folder, a pipe and a socket, and for a path that does not exist."""

_LFS: Final = b"version https://git-lfs.github.com/spec/"
"""How the text begins that Git leaves in place of a large file."""

_KINDS: Final[tuple[tuple[Callable[[int], bool], str], ...]] = (
    (stat.S_ISDIR, FOLDER),
    (stat.S_ISFIFO, PIPE),
    (stat.S_ISSOCK, SOCKET),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def found_instead(path: Path) -> str:
    """Return what is there in place of a regular file; empty for a regular file. Never raises, and opens nothing."""
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        return NOTHING
    except OSError as error:  # a name that is too long, a folder without permission, a loop of links
        return str(error.strerror or error)
    except ValueError as error:  # a path with a NUL
        return str(error)
    return next((name for is_kind, name in _KINDS if is_kind(mode)), "")


def open_regular(
    path: Path,
    what: str = READABLE,
    *,
    most: int | None = None,
    refused: type[CollisionMonitorError] = InputError,
) -> BinaryIO:
    """Open a regular file to read its bytes.

    what: is expected, for the text of the error, such as `a mesh file`. most: bytes. refused: what is raised if the
    file is no regular one, cannot be opened, is longer, or is a pointer of Git LFS in place of the file.
    """
    shown = repr(str(path)) if "\0" in str(path) else str(path)
    if found := found_instead(path):
        raise refused(f"{shown}: expected {what}, got {found}")
    try:
        # the path may lead to a pipe by now, of which a blocking open would wait for a writer
        number = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        stream = open(number, "rb")  # noqa: SIM115 - the caller closes it
    except OSError as error:
        raise refused(f"{shown}: expected {what}, got {error.strerror or error}") from None
    try:
        status = os.fstat(number)
        if not stat.S_ISREG(status.st_mode):
            raise refused(f"{shown}: expected {what}, got no regular file")
        if most is not None and status.st_size > most:
            raise refused(f"{shown}: expected {what}, of at most {most} bytes, got {status.st_size}")
        if (stream.peek(len(_LFS)) or b"").startswith(_LFS):
            raise refused(
                f"{shown}: expected {what}, got a Git LFS pointer to it; `git lfs pull` in its repository fetches the "
                "file"
            )
    except OSError as error:
        stream.close()
        raise refused(f"{shown}: expected {what}, got {error.strerror or error}") from None
    except BaseException:
        stream.close()
        raise
    return stream


def read_regular(
    path: Path, what: str = READABLE, *, most: int, refused: type[CollisionMonitorError] = InputError
) -> bytes:
    """Return the bytes of a regular file, `most` at most. Raises `refused` as `open_regular` does."""
    with open_regular(path, what, most=most, refused=refused) as stream:
        try:
            data = stream.read(most + 1) or b""  # None: nothing is there to read without waiting
        except OSError as error:
            raise refused(f"{path}: expected {what}, got {error.strerror or error}") from None
    if len(data) > most:  # it has grown, or the system gives it no size
        raise refused(f"{path}: expected {what}, of at most {most} bytes, got more")
    return data
