"""Places of the compiled kernels: read wherever they may be read, written to the first place that may be written.

A cached kernel is code that runs. A folder counts only if nobody else can have put a file there: its owner is root,
this user or the owner of this package, whose code runs anyway, and neither its group nor others may write to it.
"""

from __future__ import annotations

import contextlib
import logging
import os
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

FOLDER: Final = "collision_monitor"
"""Name of our folder in each place but NUMBA_CACHE_DIR, which is a folder itself."""

OTHERS_WRITE: Final = stat.S_IWGRP | stat.S_IWOTH

_distrusted: set[Path] = set()


def kernel_places() -> Iterator[Path]:
    """Yield the folders that may hold kernels, the first choice first; they need not exist.

    NUMBA_CACHE_DIR is the only one if it can be written to: then it is as if there were no others.
    """
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        yield (place := Path(chosen).resolve())
        if os.access(next(each for each in (place, *place.parents) if each.exists()), os.W_OK):
            return
    is_environment = sys.prefix != sys.base_prefix
    yield Path(sys.prefix if is_environment else "/") / "var" / "cache" / FOLDER
    with contextlib.suppress(RuntimeError):  # neither HOME nor an entry in the list of users
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / FOLDER
    with contextlib.suppress(OSError):  # no temporary folder either
        yield Path(tempfile.gettempdir()) / f"{FOLDER}_{_user()}"


def _user() -> int:
    return os.geteuid() if hasattr(os, "geteuid") else 0


def _is_ours(status: os.stat_result) -> bool:
    """Whether only this user, root and the owner of this package can have written a file or to a folder."""
    if not hasattr(os, "geteuid"):  # Windows has no such owners; its folders of a user are the user's own
        return True
    owners = {0, os.geteuid(), os.stat(__file__).st_uid, _owner_of_chosen()}
    return status.st_uid in owners and not status.st_mode & OTHERS_WRITE


def _owner_of_chosen() -> int:
    """Owner of NUMBA_CACHE_DIR, whom its user names by the variable; root if there is none."""
    try:
        return os.stat(os.environ.get("NUMBA_CACHE_DIR") or "/").st_uid
    except OSError:
        return 0


def is_trusted(place: Path, name: str = "") -> bool:
    """Whether a place, and the folder of this name in it, exist and can only hold what we would run anyway."""
    for each in (place, place / name):
        try:
            status = os.lstat(each)
        except OSError:
            return False
        if not (stat.S_ISDIR(status.st_mode) and _is_ours(status)):
            _warn(each)
            return False
    return True


def _warn(folder: Path) -> None:
    if folder not in _distrusted:
        _distrusted.add(folder)
        logging.getLogger(FOLDER).warning(
            f"{folder}: expected a folder that nobody else may write to, got one that others may; its compiled kernels "
            "are not used. If its content is yours, `chmod -R go-w` it"
        )


def read_kernel(path: Path) -> bytes:
    """Return the content of a file in a trusted folder. Raises OSError, also for a file that others may write."""
    with path.open("rb") as stream:
        if not _is_ours(os.fstat(stream.fileno())):
            raise PermissionError(f"{path}: others may write it")
        return stream.read()


def write_kernel(place: Path, name: str, file: str, content: bytes) -> None:
    """Write a file into the folder of this name, in one step, for everyone to read. Raises OSError."""
    place.parent.mkdir(parents=True, exist_ok=True)
    for each in (place, place / name):
        with contextlib.suppress(FileExistsError):
            each.mkdir(mode=0o755)
    if not is_trusted(place, name):
        raise PermissionError(f"{place}: others may write to it")
    temporary = place / name / f"{file}.{os.getpid()}.{os.urandom(4).hex()}"
    try:
        with os.fdopen(os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644), "wb") as stream:
            stream.write(content)
        os.replace(temporary, place / name / file)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise
