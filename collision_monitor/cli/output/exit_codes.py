"""The exit codes of all commands."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Result of a command. The --help of each command lists the codes that it returns."""

    DONE = 0
    ERROR = 1
    USAGE = 2
    NOT_AS_EXPECTED = 3
    NOT_KNOWN = 4
    INTERRUPTED = 128 + 2
    """The code by which a shell reports SIGINT."""
    BROKEN_PIPE = 128 + 13
    """The code by which a shell reports SIGPIPE."""
