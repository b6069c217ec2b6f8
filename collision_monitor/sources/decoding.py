"""Message bytes to objects with the fields of the message, by the library rosbags, which needs no ROS.

Types of which a message holds thousands of elements are read as arrays instead, if their definition has the layout for
which the reader is written.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, Final

import numpy as np

from collision_monitor.codec.cdr import ENCAPSULATION
from collision_monitor.errors import MessageError
from collision_monitor.sources.messages.autoware_bytes import HASHES, read_tracks
from collision_monitor.sources.messages.clouds import CLOUD
from collision_monitor.sources.messages.laser_scans import SCAN
from collision_monitor.sources.messages.marker_arrays import (
    MARKER,
    MARKER_HASHES,
    MARKERS,
    markers_of,
    read_markers,
)
from collision_monitor.sources.messages.transform_arrays import (
    TRANSFORMS,
    TRANSFORMS_HASH,
    read_transforms,
    transforms_of,
)
from collision_monitor.sources.robot.collision_objects import with_solids
from collision_monitor.sources.robot.planning_scene import COLLISION_OBJECT, PLANNING_SCENE
from collision_monitor.sources.robot.robot_source import TEXT

_HASHES: Final = {**HASHES, **MARKER_HASHES, TRANSFORMS: TRANSFORMS_HASH}

_READERS: Final[dict[str, Callable[[bytes], Any]]] = {
    **{name: partial(read_tracks, predicted=name.endswith("PredictedObjects")) for name in HASHES},
    MARKER: partial(read_markers, single=True),
    MARKERS: partial(read_markers, single=False),
    TRANSFORMS: read_transforms,
}
"""Read the bytes of a type, if its definition has the hash in _HASHES. They raise MessageError."""

_FROM_OBJECTS: Final[dict[str, Callable[[Any], Any]]] = {
    MARKER: markers_of,
    MARKERS: markers_of,
    TRANSFORMS: transforms_of,
    PLANNING_SCENE: with_solids,
    COLLISION_OBJECT: with_solids,
}
"""Make the same arrays of the objects of another definition, such as that of an older ROS 2; or the shapes in them."""

_QUICK_BYTES: Final = {PLANNING_SCENE: 10_000, COLLISION_OBJECT: 10_000}
"""Bytes of a message up to which its decoder takes at most 0.05 s, if that is less than QUICK_MESSAGE."""

QUICK_MESSAGE: Final = 200_000
"""The same for the other types."""

_ALWAYS_QUICK: Final = (TRANSFORMS, SCAN, CLOUD, TEXT)
"""Types that are read at once, however large: tf comes before what it places; the others are arrays or one text."""


def decodes_slowly(message_type: str, size: int) -> bool:
    """Return whether a message of so many bytes may take longer to decode than the callbacks of a node may wait."""
    return message_type not in _ALWAYS_QUICK and size > _QUICK_BYTES.get(message_type, QUICK_MESSAGE)


class Decoder:
    """Decodes by the definitions of ROS 2 Jazzy, and by further ones, which take their place.

    definitions: fields of further types, as `rosbags.typesys` returns them.
    """

    def __init__(self, definitions: dict[str, Any]) -> None:
        self.use(definitions)

    def use(self, definitions: dict[str, Any]) -> None:
        """Decode by these definitions and those of Jazzy from now on."""
        from rosbags.typesys import Stores, get_typestore

        self._fits: dict[str, bool] = {}
        self._types = get_typestore(Stores.EMPTY)
        self._types.register({**get_typestore(Stores.ROS2_JAZZY).fielddefs, **definitions})

    def define(self, message_type: str, text: str) -> None:
        """Add the definition of a type, and of those in it, in the form of rosbag2 (`ros2msg`)."""
        from rosbags.typesys import get_types_from_msg

        self._types.register(get_types_from_msg(text, message_type))
        self._types.get_msgdef(message_type)  # generates the code now, and not when the first message waits
        self._fits.clear()
        if message_type in _READERS:
            with suppress(MessageError):  # which the first message raises again
                self._has_known_layout(message_type)

    def __call__(self, message_type: str, data: bytes) -> Any:
        """Return the message. Raises MessageError."""
        with np.errstate(all="ignore"):  # numbers that are none: the monitor refuses them
            return self._decoded(message_type, data)

    def _decoded(self, message_type: str, data: bytes) -> Any:
        is_little = data[:2] == ENCAPSULATION[:2] or message_type not in _FROM_OBJECTS
        if message_type in _READERS and is_little and self._has_known_layout(message_type):
            return _READERS[message_type](data)
        try:
            found = self._types.deserialize_cdr(data, message_type)
        except Exception as error:  # the library raises one for each kind of damage
            reason = str(error) or type(error).__name__
            raise MessageError(f"expected a {message_type}, cannot be decoded: {reason:.200}") from None
        return _FROM_OBJECTS[message_type](found) if message_type in _FROM_OBJECTS else found

    def _has_known_layout(self, message_type: str) -> bool:
        """Whether the definition is the one that the reader of the type is written for. Raises MessageError."""
        if message_type not in self._fits:
            try:
                found = self._types.hash_rihs01(message_type)
            except Exception as error:  # such as a type that no definition has
                raise MessageError(f"expected a known {message_type}, got: {error!r:.200}") from None
            self._fits[message_type] = found == _HASHES[message_type]
            if not self._fits[message_type] and message_type not in _FROM_OBJECTS:
                expected = _HASHES[message_type]
                raise MessageError(f"expected a {message_type} with the type hash {expected}, got {found}")
        return self._fits[message_type]
