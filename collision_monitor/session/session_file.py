"""One MCAP file of a session, as rosbag2 writes it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from mcap.writer import Writer

from collision_monitor._version import VERSION
from collision_monitor.session.rosbag2 import Extent, channel_metadata, file_metadata, full_name

METADATA: Final = "collision_monitor"
"""Name of the metadata record that makes an MCAP file a session."""


class SessionFile:
    """Being written. definitions: of each type in types.values(). Raises OSError, as all of its methods do."""

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
        self._counts: Counter[str] = Counter()
        self._begin = self._end = 0
        self._stream = path.open("wb" if overwrite else "xb")
        try:
            self._writer = Writer(self._stream)
            self._writer.start(profile="ros2", library=f"collision_monitor {VERSION}")
            self._writer.add_metadata(METADATA, dict(metadata))
            schemas = {
                name: self._writer.register_schema(full_name(name), "ros2msg", text)
                for name, text in definitions.items()
            }
            # One channel for each topic. They go into the first chunk, before the first message.
            self._channels = {
                topic: self._writer.register_channel(topic, "cdr", schemas[name], channel_metadata(name))
                for topic, name in types.items()
            }
            self._writer.flush()  # type: ignore[no-untyped-call]
        except BaseException:
            self.close()
            raise

    @property
    def size(self) -> int:
        """Bytes that the operating system has."""
        return self._stream.tell()

    @property
    def begin(self) -> int | None:
        """Log time of the first message (ns)."""
        return self._begin if self._counts else None

    @property
    def extent(self) -> Extent:
        """What it holds so far."""
        return Extent(self._begin, self._end, self._counts)

    def write(self, topic: str, data: bytes, log_time: int, publish_time: int, sequence: int) -> None:
        """Append a message; log times must not decrease."""
        self._writer.add_message(self._channels[topic], log_time, data, publish_time, sequence)
        if not self._counts:
            self._begin = log_time
        self._end = log_time
        self._counts[topic] += 1

    def flush(self) -> None:
        """Hand everything to the operating system, which keeps it when this process is killed."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def finish(self) -> None:
        """Write the summary, with rosbag2's metadata as a record, and close the file."""
        text = file_metadata({self.path.name: self.extent}, self._types)
        self._writer.add_metadata("rosbag2", {"serialized_metadata": text})
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._stream.close()

    def close(self) -> None:
        """Close the file as it is."""
        with suppress(OSError):  # what could not be written has been reported already
            self._stream.close()
