"""The interface between a source and the pipeline.

A source takes messages of its topics and writes what they hold into the `SourceScene`: descriptions, removals and
states in the monitor's frame. The `Feed` gives it the messages, decides when a step is made, and turns the scene into
ObjectDescriptionArray and ObjectStateArray bytes. Neither knows whether a message came from DDS or from a bag.

A further kind of source is one class with these members, and one line in `kinds.py`: in `BY_TYPE` if an entry of
`objects:` uses it, by the type of its topic; in `_SECTIONS` if it has a section of the sources file of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from collision_monitor.sources.ground.source_scene import SourceScene


class RawMessage(NamedTuple):
    """A message as DDS or a bag delivers it: CDR bytes, and the time of receipt in ns."""

    topic: str
    type: str
    data: bytes
    received: int


class Source:
    """Converts the messages of its topics. name: the line of the file. topics: the types that each topic may carry.

    speaks: whether its topics carry a message again and again, so that silence means that the sensor failed. awaited:
    whether something is not monitored while there is no message.
    """

    name: str
    topics: Mapping[str, tuple[str, ...]]
    speaks = True
    awaited = True

    def begin(self, scene: SourceScene) -> None:
        """Describe what is known before the first message. Called once. Raises InputError, SessionError."""

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """Process a decoded message.

        What cannot be used is given to `scene.refuse`, or raised within a `scene.guard` around the element; what is
        raised out of here loses the rest of the message.

        stamp_ns: the message's stamp, or that of the others if it has none.
        """
        raise NotImplementedError

    def settle(self, now_ns: int, scene: SourceScene) -> None:
        """Write what waits, and remove what has expired. Called before each step, with the step's stamp.

        A source of many messages for each step decodes them in `take` and computes states here.
        """

    def restart(self, now_ns: int, scene: SourceScene) -> None:
        """Forget all earlier times: time jumped to `now_ns`, or went back to it. Objects stay."""

    def forget_plans(self) -> None:
        """Forget which plans objects follow: the monitor begins anew with the next step, without them."""
