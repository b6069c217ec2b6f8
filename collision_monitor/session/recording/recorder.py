"""Writes a session as MCAP by rosbag2's conventions, on a thread of its own. The caller never waits and never fails."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Final

from collision_monitor.errors import SessionError
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.session.mcap.layout import SEQUENCE_MASK
from collision_monitor.session.mcap.rosbag2 import RECORDED_TYPES
from collision_monitor.session.recording.queue_entry import QueueEntry
from collision_monitor.session.recording.recording_files import SNAPSHOT_PERIOD, RecordingFiles
from collision_monitor.session.recording.recording_state import Recording
from collision_monitor.session.recording.splitting import ONE_FILE, Splitting

FLUSH_PERIOD: Final = 0.25
"""Period of the flushes (s). With the grace and the duration of a flush, a killed process loses less than 0.5 s."""

QUEUE_BYTES: Final = 256 << 20
"""Bytes that may wait for the disk. Beyond it, messages are dropped and counted."""

_WAKE_BYTES: Final = 8 << 20
"""Waiting bytes that wake the thread before the next flush is due."""

EVENT_SNAPSHOT_PERIODS: Final = (0.1, 1.0)
"""Least and largest period of the snapshots of a recording around events (s); in between it is half of the time wanted
before each event. Snapshots are held back and mostly dropped, and up to one period more than wanted is kept."""

_GRACE: Final = 0.1
"""s that a due flush waits for another message. A caller hands messages over at the end of a step, so the thread then
works between two steps."""

_TURN: Final = 1024
"""Waiting messages that wake the thread, and messages after which (0.6 ms) it releases Python's lock. Otherwise a step
may wait 5 ms for the lock. Shorter turns take the lock more often: turns of 128 messages cost a step twice as much."""

_LARGE: Final = 24 << 20
"""Bytes of one block that is allocated and freed at once. From then on the C library keeps freed blocks below that
size. Otherwise it returns each chunk's memory to the system and gets it back page by page, half of a message's cost."""

_PAUSE: Final = 20e-6
"""s; long enough that a thread which waits for the lock wakes up and takes it."""


class Recorder:
    """Recorder of one session.

    path: a new `.mcap` file, or a new folder with any other name (with a metadata.yaml, like that of `ros2 bag
    record`).
    types: topic -> message name, such as `ContactArray`. metadata: from `Pipeline.metadata`.
    patient: `write` waits for the disk if the queue is full, instead of dropping the message.
    snapshots: the caller writes one whenever `snapshot_due`. A replay can begin there, and every file begins with one.
    Raises SessionError if the file cannot be made, or exists and `overwrite` is false.
    """

    def __init__(
        self,
        path: str | Path,
        types: Mapping[str, str],
        metadata: Mapping[str, str],
        *,
        splitting: Splitting = ONE_FILE,
        overwrite: bool = False,
        queue_bytes: int = QUEUE_BYTES,
        patient: bool = False,
        snapshots: bool = False,
    ) -> None:
        unknown = [name for name in types.values() if name not in RECORDED_TYPES]
        if unknown:
            raise SessionError(f"message type: expected one of {', '.join(RECORDED_TYPES)}, got {', '.join(unknown)}")
        self.path = Path(path)
        self._topics = frozenset(types)
        self._queue_bytes = queue_bytes
        self._patient = patient
        self._snapshots = snapshots
        self._snapshot_period = round(_snapshot_period(splitting) * 1e9)
        self._last_snapshot: int | None = None  # log time (ns) of the last one, or of the first message
        self._is_full = False

        self._wake = threading.Condition()
        self._queue: list[QueueEntry] = []
        self._waiting = 0
        self._closing = False
        self._next_sequence = 0
        self._last_log_time = 0
        self._state = Recording.ON
        self._error = ""
        self._dropped = 0
        self._recorded = 0
        self._recorded_bytes = 0
        self._flush_due = time.monotonic() + FLUSH_PERIOD
        self._taken = 0  # messages that the thread wrote or did not keep
        self._unflushed = self._unflushed_written = 0  # the same, and the written ones, since the last flush
        bytes(_LARGE)
        self._files = _create(self.path, types, metadata, splitting, overwrite, snapshots)
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    # -- the caller's side

    def write(
        self,
        topic: str,
        data: bytes,
        log_time: int,
        publish_time: int,
        *,
        event: bool = False,
        objects: Sequence[ObjectDescription] | None = None,
        settings: Mapping[str, str] | None = None,
    ) -> None:
        """Put one message on the queue. Messages are recorded in the order of these calls. Times in ns.

        event: a collision begins in it. objects: if the message changes the objects, all that are described afterwards;
        each further file begins with them. settings: if the message changes settings, those in force afterwards,
        from `Pipeline.settings`.

        A log time before the last one is raised to it. A message that finds the queue full is dropped and counted. Its
        sequence number stays unused, so that a replay notices. Raises KeyError for a topic that is not in `types`.
        """
        if topic not in self._topics:
            raise KeyError(topic)
        with self._wake:
            sequence = self._next_sequence & SEQUENCE_MASK
            self._last_log_time = max(self._last_log_time, log_time)
            if self._last_snapshot is None:
                self._last_snapshot = self._last_log_time
            fields = topic, data, self._last_log_time, max(0, publish_time), sequence, event, objects, None, settings
            entry = QueueEntry._make(fields)  # four times as fast as the constructor
            cost = entry.cost
            while self._patient and self._state is Recording.ON and self._waiting + cost > self._queue_bytes:
                self._wake.notify()
                self._wake.wait(FLUSH_PERIOD)
            self._next_sequence += 1
            if self._closing or self._state is Recording.FAILED or self._waiting + cost > self._queue_bytes:
                self._dropped += 1
                return
            self._queue.append(entry)
            self._waiting += cost
            if len(self._queue) >= _TURN or self._waiting >= _WAKE_BYTES or time.monotonic() >= self._flush_due:
                self._wake.notify()

    @property
    def snapshot_due(self) -> bool:
        """Whether a snapshot is due: every 10 s, more often around events, or if another file is to begin."""
        if not self._snapshots or self._last_snapshot is None:
            return False
        return self._is_full or self._last_log_time - self._last_snapshot >= self._snapshot_period

    def write_snapshot(self, snapshot: Snapshot) -> None:
        """Put the monitor's state after all messages so far on the queue, or drop it if the queue is full."""
        with self._wake:
            self._last_snapshot = self._last_log_time
            self._is_full = False
            sequence = self._next_sequence & SEQUENCE_MASK
            entry = QueueEntry("", b"", self._last_log_time, 0, sequence, snapshot=snapshot)
            if not self._closing and self._state is Recording.ON and self._waiting + entry.cost <= self._queue_bytes:
                self._queue.append(entry)
                self._waiting += entry.cost

    def status(self) -> dict[str, int | str]:
        """Return the recording fields of MonitorStatus. Recorded messages are those that the operating system has."""
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
        """Write the waiting messages and finish the file. Errors appear in `status()`."""
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
            self._files.finish()
            with self._wake:
                self._recorded_bytes = self._files.size
        except Exception as error:  # no error may reach the caller; the status reports it
            reason = error.strerror if isinstance(error, OSError) and error.strerror else repr(error)
            with self._wake:
                self._state = Recording.FAILED
                self._error = f"{self.path}: {reason}"
                self._dropped = self._next_sequence - self._taken
                self._queue.clear()
        finally:
            self._files.close()

    def _write_what_waits(self) -> bool:
        """Sleep until there is work, then write. Return False if the session is closed and nothing is left."""
        with self._wake:
            if not self._closing and len(self._queue) < _TURN and self._waiting < _WAKE_BYTES:
                self._wake.wait(max(0.0, self._flush_due + _GRACE - time.monotonic()))
            batch, self._queue = self._queue, []
            size, closing = self._waiting, self._closing
        for begin in range(0, len(batch), _TURN):
            turn = batch[begin : begin + _TURN]
            self._unflushed_written += self._files.write(turn)
            self._unflushed += sum(entry.snapshot is None for entry in turn)
            if time.monotonic() >= self._flush_due:
                self._flush()
            elif begin + _TURN < len(batch):
                time.sleep(_PAUSE)
        if closing or time.monotonic() >= self._flush_due:
            self._flush()
        with self._wake:
            self._waiting -= size
            self._is_full = self._files.is_full
            self._wake.notify_all()
        return not closing

    def _flush(self) -> None:
        if self._unflushed:
            self._files.flush()
        with self._wake:
            self._taken += self._unflushed
            self._recorded += self._unflushed_written
            self._recorded_bytes = self._files.size
            self._flush_due = time.monotonic() + FLUSH_PERIOD
        self._unflushed = self._unflushed_written = 0


def _snapshot_period(splitting: Splitting) -> float:
    if not splitting.on_event:
        return SNAPSHOT_PERIOD
    least, most = EVENT_SNAPSHOT_PERIODS
    return min(max(least, 0.5 * splitting.before), most)


def _create(
    path: Path,
    types: Mapping[str, str],
    metadata: Mapping[str, str],
    splitting: Splitting,
    overwrite: bool,
    snapshots: bool,
) -> RecordingFiles:
    """Make the file, in a new folder unless the path ends in `.mcap`. Raises SessionError."""
    try:
        return RecordingFiles(path, types, metadata, splitting, overwrite=overwrite, snapshots=snapshots)
    except FileExistsError:
        raise SessionError(
            f"{path}: expected a new file, got one that exists; choose another name or remove it"
        ) from None
    except OSError as error:
        if not (folder := path.parent).exists():
            raise SessionError(f"{path}: expected an existing folder {folder}, got none; create it first") from None
        raise SessionError(f"{path}: expected to be able to write there, got: {error.strerror}") from None
