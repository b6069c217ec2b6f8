"""Large messages of other programs, decoded by a thread of their own: a scene with meshes takes Python a second.

The thread holds Python's lock for 5 ms at a time, so that the callbacks of the node go on between. The messages of one
topic stay in order: while a large one is being decoded, those behind it wait.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable
from typing import Any, Final

from collision_monitor.sources import RawMessage
from collision_monitor.sources.decoding import decodes_slowly

MOST_WAITING_BYTES: Final = 256 << 20
"""Bytes of messages that may wait. Further ones are refused."""

Decoded = tuple[RawMessage, Any]
"""A message, and its content or the exception that its decoder raised."""


class LargeMessages:
    """Decodes what `takes` it. decode: raises MessageError."""

    def __init__(self, decode: Callable[[str, bytes], Any]) -> None:
        self._decode = decode
        self._wake = threading.Condition()
        self._waiting: deque[RawMessage] = deque()
        self._bytes = 0
        self._topics: Counter[str] = Counter()  # of messages that wait or are not taken yet
        self._done: deque[Decoded] = deque()
        self._thread: threading.Thread | None = None
        self._closed = False

    def takes(self, raw: RawMessage) -> bool:
        """Whether a message is to be decoded here: that takes long, or one of its topic is before it."""
        return decodes_slowly(raw.type, len(raw.data)) or self._topics[raw.topic] > 0

    def put(self, raw: RawMessage) -> bool:
        """Let a message be decoded. Return False if too many wait."""
        with self._wake:
            if self._closed or self._bytes + len(raw.data) > MOST_WAITING_BYTES:
                return False
            self._waiting.append(raw)
            self._bytes += len(raw.data)
            self._topics[raw.topic] += 1
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="large messages", daemon=True)
                self._thread.start()
            self._wake.notify()
        return True

    def next(self) -> Decoded | None:
        """Return the next message that is decoded; None if there is none yet."""
        if not self._topics:
            return None
        with self._wake:
            if not self._done:
                return None
            raw, content = self._done.popleft()
            self._bytes -= len(raw.data)
            self._topics[raw.topic] -= 1
            self._topics += Counter()  # without those that are 0
            return raw, content

    def close(self) -> None:
        """End the thread behind its message."""
        with self._wake:
            self._closed = True
            self._waiting.clear()
            self._wake.notify()

    def _run(self) -> None:
        while True:  # until `close`
            with self._wake:
                self._wake.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                raw = self._waiting.popleft()
            try:
                content = self._decode(raw.type, raw.data)
            except Exception as error:  # the feed refuses the message
                content = error
            with self._wake:
                self._done.append((raw, content))
