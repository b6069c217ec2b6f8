"""The recording of a node: its topics, and its messages in the log. If it fails, the monitoring continues."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rclpy.node import Node

from collision_monitor.errors import SessionError
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.pipeline.topics import RECORDED, Topic
from collision_monitor.session import Recording, Splitting

if TYPE_CHECKING:
    from collision_monitor.session import Recorder


class NodeRecording:
    """Records a node's messages under the topics' full names.

    path: empty for no recording. A recording that cannot start is logged, and `status` reports it.
    """

    def __init__(self, node: Node, path: str, metadata: Callable[[], dict[str, str]], splitting: Splitting) -> None:
        self._logger = node.get_logger()
        self._names = {topic: node.resolve_topic_name(topic.private) for topic in RECORDED}
        self._recorder: Recorder | None = None
        self._last: dict[str, Any] = {}  # the status at the last call of `log_problems`
        if path:
            self._start(path, metadata(), splitting)

    def _start(self, path: str, metadata: dict[str, str], splitting: Splitting) -> None:
        types = {name: topic.message for topic, name in self._names.items()}
        try:
            from collision_monitor.session import Recorder  # needs packages that rosdep does not install

            self._recorder = Recorder(path, types, metadata, splitting=splitting, snapshots=True)
        except ModuleNotFoundError as error:
            self._fail(path, f"expected the Python packages for MCAP, got no {error.name}: pip install mcap")
        except SessionError as error:
            self._fail(path, str(error))

    def _fail(self, path: str, reason: str) -> None:
        self._logger.error(f"not recording: {reason}")
        self._last = {"recording": Recording.FAILED, "recording_path": path, "recording_error": reason}

    def __str__(self) -> str:
        return f"recording to {self._recorder.path}" if self._recorder else "not recording"

    @property
    def is_on(self) -> bool:
        """Whether messages are recorded."""
        return self._recorder is not None

    def write(self, topic: Topic, data: bytes, log_time: int, publish_time: int, **what: Any) -> None:
        """Record a message, as `Recorder.write` does."""
        if self._recorder is not None:
            self._recorder.write(self._names[topic], data, log_time, publish_time, **what)

    def write_snapshot_if_due(self, snapshot: Callable[[], Snapshot]) -> None:
        """Record a snapshot, as `Recorder.write_snapshot` does, if one is due."""
        if self._recorder is not None and self._recorder.snapshot_due:
            self._recorder.write_snapshot(snapshot())

    def status(self) -> dict[str, Any]:
        """Return the recording fields of MonitorStatus."""
        return self._last if self._recorder is None else self._recorder.status()

    def log_problems(self) -> None:
        """Log a failed recording or dropped messages since the last call, for people who read no status."""
        if self._recorder is None:
            return
        last, now = self._last, self._recorder.status()
        self._last = now
        if now["recording"] == Recording.FAILED:  # from then on every message counts as dropped
            if last.get("recording") != Recording.FAILED:
                self._logger.error(f"the recording failed, the monitoring goes on: {now['recording_error']}")
        elif now["recording_dropped"] != last.get("recording_dropped", 0):
            self._logger.warning(
                f"the disk is too slow for the recording: {now['recording_dropped']} messages dropped so far"
            )

    def finish(self) -> None:
        """Finish the session without a word, from any thread."""
        if self._recorder is not None:
            self._recorder.close()

    def close(self) -> None:
        """Finish the session."""
        self.finish()
        self.log_problems()
