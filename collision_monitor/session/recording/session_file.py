"""One MCAP file of a session, as rosbag2 writes it."""

from __future__ import annotations

import errno
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from collision_monitor._version import VERSION
from collision_monitor.session.mcap.layout import LIBRARY, METADATA, SNAPSHOT
from collision_monitor.session.mcap.rosbag2 import FileInformation, channel_metadata, file_metadata, full_name
from collision_monitor.session.mcap.writer import McapWriter
from collision_monitor.session.recording.queue_entry import QueueEntry


class SessionFile:
    """A session file being written. definitions: text of each type in types.values(). All methods raise OSError.

    A file whose beginning cannot be written is removed: nothing could be replayed from it.
    """

    def __init__(
        self,
        path: Path,
        types: Mapping[str, str],
        metadata: Mapping[str, str],
        definitions: Mapping[str, bytes],
        *,
        overwrite: bool = False,
    ) -> None:
        self.path = path
        self._types = types
        self._begin: int | None = None
        self._stream = path.open("wb" if overwrite else "xb")
        try:
            self._writer = McapWriter(self._stream, profile="ros2", library=f"{LIBRARY} {VERSION}")
            self._writer.add_metadata(METADATA, metadata)
            schemas = {
                name: self._writer.add_schema(full_name(name), "ros2msg", text) for name, text in definitions.items()
            }
            # One channel for each topic. They go into the first chunk, before the first message.
            self._channels = {
                topic: self._writer.add_channel(topic, "cdr", schemas[name], channel_metadata(name))
                for topic, name in types.items()
            }
            self._writer.flush()
        except BaseException:
            self.discard()
            raise

    @property
    def size(self) -> int:
        """Bytes that the operating system has."""
        return self._stream.tell()

    @property
    def begin(self) -> int | None:
        """Log time of the first message (ns)."""
        return self._begin

    @property
    def information(self) -> FileInformation:
        """Begin, end and counts of the flushed messages."""
        counts = {topic: self._writer.counts[channel] for topic, channel in self._channels.items()}
        return FileInformation(self._writer.begin, self._writer.end, counts)

    def write(self, entries: Sequence[QueueEntry]) -> None:
        """Append messages; log times must not decrease."""
        if not entries:
            return
        self._begin = entries[0].log_time if self._begin is None else self._begin
        topics, data, log_times, publish_times, sequences, *_ = zip(*entries, strict=True)
        channels = list(map(self._channels.__getitem__, topics))
        self._writer.add_messages(channels, data, log_times, publish_times, sequences)

    def write_snapshot(self, data: bytes, sequence: int, log_time: int) -> None:
        """Append the monitor's state before message `sequence`, from `Snapshot.encode`."""
        self._writer.add_attachment(f"{SNAPSHOT}{sequence}.npz", "application/x-npz", data, log_time)

    def flush(self) -> None:
        """Hand everything to the operating system, which keeps it if this process is killed.

        Raises FileNotFoundError if the file was removed or renamed: the system goes on taking what nobody can read.
        """
        self._writer.flush()
        if os.fstat(self._stream.fileno()).st_nlink == 0 or not self.path.exists():
            raise FileNotFoundError(errno.ENOENT, "the file was removed or renamed during the recording")

    def finish(self) -> None:
        """Write the summary, with rosbag2's metadata as a record, and close the file."""
        self.flush()
        text = file_metadata({self.path.name: self.information}, self._types)
        self._writer.add_metadata("rosbag2", {"serialized_metadata": text})
        self._writer.finish()
        self._stream.close()

    def close(self) -> None:
        """Close the file as it is."""
        with suppress(OSError):  # a failed write has been reported already
            self._stream.close()

    def discard(self) -> None:
        """Close the file and remove it, unless the path is a link or a device."""
        self.close()
        with suppress(OSError):
            if self.path.is_file() and not self.path.is_symlink():
                self.path.unlink()
