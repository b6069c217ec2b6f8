"""Paths that lead to no regular file, or to too much of one, with the words by which an error calls them."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable
from pathlib import Path

POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:{}\nsize 123456\n".format("0123456789abcdef" * 4)


def pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


def link_to(target: str) -> Callable[[Path], Path]:
    def make(path: Path) -> Path:
        path.symlink_to(target)
        return path

    return make


def folder(path: Path) -> Path:
    path.mkdir()
    return path


def bound_socket(path: Path) -> Path:
    here = Path.cwd()
    os.chdir(path.parent)  # the name of a socket has 107 bytes at most
    try:
        with socket.socket(socket.AF_UNIX) as each:
            each.bind(path.name)
    finally:
        os.chdir(here)
    return path


def loop(path: Path) -> Path:
    path.symlink_to(path)
    return path


def pointer(path: Path) -> Path:
    path.write_text(POINTER)
    return path


def sparse(path: Path) -> Path:
    """A terabyte that takes no room on the disk."""
    with path.open("wb") as file:
        file.truncate(1 << 40)
    return path


def long_name(path: Path) -> Path:
    return path.with_name("x" * 300 + path.suffix)


def missing(path: Path) -> Path:
    return path


NO_FILES: dict[str, tuple[Callable[[Path], Path], str]] = {
    "pipe": (pipe, "a named pipe"),
    "endless device": (link_to("/dev/zero"), "a device"),
    "empty device": (link_to("/dev/null"), "a device"),
    "socket": (bound_socket, "a socket"),
    "folder": (folder, "a folder"),
    "loop of links": (loop, "symbolic links"),
    "missing": (missing, "nothing there"),
    "long name": (long_name, "too long"),
    "LFS pointer": (pointer, "a Git LFS pointer"),
}
