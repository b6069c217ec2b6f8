"""Messages for which a source failed in a way that nobody expected, kept in files so that the error can be reported."""

from __future__ import annotations

import base64
import json
import traceback
from pathlib import Path
from typing import Any, Final, NamedTuple

from collision_monitor.settings.regular_file import read_regular
from collision_monitor.sources.ground.source import RawMessage

MOST_FAILURE_FILES: Final = 20
"""Files of one run. The same error comes again with the next message."""

MOST_KEPT_FAILURES: Final = 20
"""Failures that wait until someone takes them."""

LARGEST_MESSAGE: Final = 16 << 20
"""Bytes of a message that is kept."""


class SourceFailure(NamedTuple):
    """line: the key in the sources file. text: the error, with its place. message: the one that led to it."""

    line: str
    text: str
    message: RawMessage

    @property
    def kind(self) -> str:
        """The type of the error and its place, equal for equal errors."""
        return f"{self.message.type}: {self.text.strip().splitlines()[-1]:.200}"


def source_failure(line: str, error: Exception, message: RawMessage) -> SourceFailure:
    """Return what is kept of an error: its last calls, and the message."""
    text = "".join(traceback.format_exception(error, limit=-6))
    return SourceFailure(line, text, message)


class FailureFiles:
    """Writes failures into a folder: one file for each kind of error. A file that cannot be written changes nothing.

    The number in a file's name is the time of receipt of its message.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kinds: dict[str, Path | None] = {}

    def keep(self, failure: SourceFailure) -> tuple[Path | None, bool]:
        """Write a failure, unless one of its kind is kept. Return the file, if there is one, and whether it is new."""
        if failure.kind in self._kinds:
            return self._kinds[failure.kind], False
        if len(self._kinds) >= MOST_FAILURE_FILES:
            return None, False
        message = failure.message
        path: Path | None = self._folder / f"source_failure_{message.received}_{len(self._kinds) + 1}.json"
        content = {
            "line": failure.line,
            "error": failure.text,
            "topic": message.topic,
            "type": message.type,
            "received": message.received,
            "bytes": len(message.data),
            "data": base64.b64encode(message.data[:LARGEST_MESSAGE]).decode(),
        }
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            assert path is not None
            path.write_text(json.dumps(content, indent=1) + "\n")
        except OSError:  # such as a disk that is full
            path = None
        self._kinds[failure.kind] = path
        return path, True


def read_failure(path: Path) -> RawMessage:
    """Return the message of a file. Raises OSError, ValueError and KeyError for another file."""
    content: dict[str, Any] = json.loads(read_regular(path, "a failure of a source", most=2 * LARGEST_MESSAGE))
    return RawMessage(content["topic"], content["type"], base64.b64decode(content["data"]), int(content["received"]))
