"""The exit codes of all commands."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """What a command came to. Each command's own help says which of these it returns, and when."""

    DONE = 0
    ERROR = 1
    USAGE = 2
    NOT_AS_EXPECTED = 3
    NOT_KNOWN = 4
    INTERRUPTED = 128 + 2
    """As a shell reports SIGINT."""
    BROKEN_PIPE = 128 + 13
    """As a shell reports SIGPIPE."""
