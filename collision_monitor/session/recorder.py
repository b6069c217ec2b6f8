"""Writes a session as MCAP by rosbag2's conventions, on a thread of its own: the caller never waits and never fails."""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from enum import IntEnum
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Final, NamedTuple

from mcap.writer import Writer

from collision_monitor._version import VERSION
from collision_monitor.errors import SessionError
from collision_monitor.session.definitions import definition
from collision_monitor.session.rosbag2 import TYPES, Extent, channel_metadata, file_metadata, full_name

METADATA: Final = "collision_monitor"
"""Name of the metadata record that makes an MCAP file a session."""

FLUSH_PERIOD: Final = 0.25
"""s between two flushes: with the time a flush takes, a killed process loses less than the last 0.5 s."""

QUEUE_BYTES: Final = 256 << 20
"""Most bytes that wait for the disk; beyond, messages are dropped and counted."""

_WAKE_BYTES: Final = 4 << 20
"""Waiting bytes that wake the thread before the next flush is due."""

_OVERHEAD: Final = 128
"""Bytes that a waiting message costs beside its data, so that empty ones are bounded too."""


class Recording(IntEnum):
    """`MonitorStatus.recording`."""

    OFF = 0
    ON = 1
    FAILED = 2


class _Item(NamedTuple):
    channel: int
    topic: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int


class Recorder:
    """A session being written.

    path: a new `.mcap` file, or a new folder of any other name (then with a metadata.yaml, as `ros2 bag record` does).
    types: topic -> message name, such as `ContactArray`. metadata: what `Pipeline.metadata` says.
    patient: `write` waits for the disk where the queue is full, instead of dropping: for a caller who has the time.
    Raises SessionError where the file cannot be made or is there already (unless overwrite).
    """

    def __init__(
        self,
        path: str | Path,
        types: Mapping[str, str],
        metadata: Mapping[str, str],
        *,
        overwrite: bool = False,
        queue_bytes: int = QUEUE_BYTES,
        patient: bool = False,
    ) -> None:
        unknown = [name for name in types.values() if name not in TYPES]
        if unknown:
            raise SessionError(f"message type: expected one of {', '.join(TYPES)}, got {', '.join(unknown)}")
        self.path = Path(path)
        self._types = dict(types)
        self._queue_bytes = queue_bytes
        self._patient = patient
        self._folder = None if self.path.suffix == ".mcap" else self.path
        definitions = {name: definition(full_name(name)).encode() for name in self._types.values()}
        self._stream = _create(self.path, overwrite)

        self._wake = threading.Condition()
        self._queue: list[_Item] = []
        self._waiting = 0
        self._closing = False
        self._next_sequence = 0
        self._last_log_time = 0
        self._state = Recording.ON
        self._error = ""
        self._dropped = 0
        self._recorded = 0
        self._recorded_bytes = 0
        self._extent = Extent(0, 0, Counter())
        try:
            self._writer = Writer(self._stream)
            self._writer.start(profile="ros2", library=f"collision_monitor {VERSION}")
            self._writer.add_metadata(METADATA, dict(metadata))
            self._channels = self._register(definitions)
            self._writer.flush()  # type: ignore[no-untyped-call]
        except OSError as error:
            self._close_stream()
            raise SessionError(f"{self.path}: expected to be able to write there, got: {error.strerror}") from None
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    # -- the caller's side

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int) -> None:
        """Put one message on the queue. Messages are recorded in the order of these calls; times in ns.

        A log time before the last one is raised to it. A message that finds the queue full is dropped and counted; its
        sequence number stays unused, so that a replay knows.
        """
        channel = self._channels[topic]
        size = len(data) + _OVERHEAD
        with self._wake:
            while self._patient and self._state is Recording.ON and self._waiting + size > self._queue_bytes:
                self._wake.notify()
                self._wake.wait(FLUSH_PERIOD)
            sequence = self._next_sequence & 0xFFFFFFFF
            self._next_sequence += 1
            if self._closing or self._state is Recording.FAILED or self._waiting + size > self._queue_bytes:
                self._dropped += 1
                return
            self._last_log_time = max(self._last_log_time, log_time)
            item = _Item(channel, topic, data, self._last_log_time, max(0, publish_time), sequence)
            self._queue.append(item)
            self._waiting += size
            if self._waiting >= _WAKE_BYTES:
                self._wake.notify()

    def status(self) -> dict[str, int | str]:
        """The recording fields of MonitorStatus. What is counted as recorded is with the operating system."""
        with self._wake:
            return {
                "recording": int(self._state),
                "recorded_messages": self._recorded,
                "recorded_bytes": self._recorded_bytes,
                "recording_dropped": self._dropped,
                "recording_path": str(self.path),
                "recording_error": self._error,
            }

    def close(self) -> None:
        """Write what waits and finish the file. What goes wrong is in `status()`."""
        with self._wake:
            self._closing = True
            self._wake.notify()
        self._thread.join()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- the thread's side

    def _run(self) -> None:
        try:
            while self._write_what_waits():
                pass
            self._finish()
        except Exception as error:  # whatever it is: the caller goes on, and the status says it
            reason = error.strerror if isinstance(error, OSError) and error.strerror else repr(error)
            with self._wake:
                self._state = Recording.FAILED
                self._error = f"{self.path}: {reason}"
                self._dropped = self._next_sequence - self._recorded
                self._queue.clear()
        finally:
            self._close_stream()

    def _write_what_waits(self) -> bool:
        """Sleep until the next flush is due, then write. False: the session is closed and nothing is left."""
        with self._wake:
            if not self._closing and self._waiting < _WAKE_BYTES:
                self._wake.wait(FLUSH_PERIOD)
            batch, self._queue = self._queue, []
            size, closing = self._waiting, self._closing
        flushed = time.monotonic()
        unflushed = 0
        for item in batch:
            self._writer.add_message(item.channel, item.log_time, item.data, item.publish_time, item.sequence)
            unflushed += 1
            if time.monotonic() - flushed >= FLUSH_PERIOD:
                self._flush(unflushed)
                flushed, unflushed = time.monotonic(), 0
        if unflushed:
            self._flush(unflushed)
        self._count(batch)
        with self._wake:
            self._waiting -= size
        return not closing

    def _flush(self, messages: int) -> None:
        """Hand everything to the operating system, which keeps it when this process is killed."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        with self._wake:
            self._recorded += messages
            self._recorded_bytes = self._stream.tell()

    def _count(self, batch: list[_Item]) -> None:
        if batch:
            begin = self._extent.begin if self._extent.counts else batch[0].log_time
            counts = Counter(self._extent.counts) + Counter(item.topic for item in batch)
            self._extent = Extent(begin, batch[-1].log_time, counts)

    def _finish(self) -> None:
        """Write the summary, and rosbag2's metadata as a record and, in a folder, as a file."""
        name = Path(self._stream.name).name
        text = file_metadata(name, self._types, self._extent)
        self._writer.add_metadata("rosbag2", {"serialized_metadata": text})
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.flush()
        if self._folder is not None:
            (self._folder / "metadata.yaml").write_text(text, encoding="utf-8")
        with self._wake:
            self._recorded_bytes = self._stream.tell()

    def _register(self, definitions: Mapping[str, bytes]) -> dict[str, int]:
        """One channel for each topic. They go into the first chunk, before the first message."""
        schemas = {
            name: self._writer.register_schema(full_name(name), "ros2msg", text) for name, text in definitions.items()
        }
        return {
            topic: self._writer.register_channel(topic, "cdr", schemas[name], channel_metadata(name))
            for topic, name in self._types.items()
        }

    def _close_stream(self) -> None:
        with suppress(OSError):  # what could not be written has been reported already
            self._stream.close()


def _create(path: Path, overwrite: bool) -> BinaryIO:
    """The new file, in a new folder unless the path ends in `.mcap`. Raises SessionError."""
    try:
        file = path
        if path.suffix != ".mcap":
            path.mkdir(exist_ok=overwrite)
            file = path / f"{path.name}_0.mcap"
        return file.open("wb" if overwrite else "xb")
    except FileExistsError:
        raise SessionError(
            f"{path}: expected a new file, got one that exists; choose another name or remove it"
        ) from None
    except FileNotFoundError:
        raise SessionError(f"{path}: expected an existing folder {path.parent}, got none; create it first") from None
    except OSError as error:
        raise SessionError(f"{path}: expected to be able to write there, got: {error.strerror}") from None
