"""The stamp that a message was given, and the stream of messages whose stamps rise."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

from collision_monitor.sources.ground.frames import LONGEST_FRAME_NAME
from collision_monitor.sources.messages.marker_arrays import MarkerArrays


def given_stamp(content: Any) -> int | None:
    """Return the stamp of a message (ns), 0 if it is left out; None for a message without a header.

    That of markers is the first that is there. The one of a joint trajectory says when it starts, not as of when it is.
    """
    if hasattr(content, "joint_names"):
        return 0
    if isinstance(content, MarkerArrays):
        return next((each for each in content.stamps if each), 0) if content.stamps else None
    header = getattr(content, "header", None)
    return None if header is None else int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def stream_of(topic: str, content: Any) -> Hashable:
    """Return what has rising stamps: the publishers of a topic have their own frames, joints or markers."""
    if isinstance(content, MarkerArrays):
        return topic, content.namespaces[0][:LONGEST_FRAME_NAME], content.ids[0]
    names = getattr(content, "name", None)
    if isinstance(names, list):  # joint states
        return topic, names[0][:LONGEST_FRAME_NAME] if names else ""
    return topic, content.header.frame_id[:LONGEST_FRAME_NAME]
