"""stdout and stderr, whatever is behind them: another encoding than UTF-8, a closed descriptor, a full disk."""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress


def accept_any_text() -> None:
    """Let both streams take any text. What their encoding lacks, such as µ in ASCII, becomes a question mark."""
    if sys.stdout is None:  # the shell closed it: `>&-`
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - until the process ends
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def discard_output() -> None:
    """Write the rest of stdout to nowhere, because Python reports an error again when it flushes stdout at the end."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
