"""Message bytes to objects with the fields of the message, by the library rosbags, which needs no ROS.

Types of which a message holds thousands of elements are read as arrays instead, if their definition has the layout for
which the reader is written.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, Final

from collision_monitor.codec.cdr import ENCAPSULATION
from collision_monitor.errors import MessageError
from collision_monitor.sources.messages.autoware_bytes import HASHES, read_tracks
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

_HASHES: Final = {**HASHES, **MARKER_HASHES, TRANSFORMS: TRANSFORMS_HASH}

_READERS: Final[dict[str, Callable[[bytes], Any]]] = {
    **{name: partial(read_tracks, predicted=name.endswith("PredictedObjects")) for name in HASHES},
    MARKER: partial(read_markers, single=True),
    MARKERS: partial(read_markers, single=False),
    TRANSFORMS: read_transforms,
}
"""Read the bytes of a type, if its definition has the hash in _HASHES. They raise MessageError."""

_FROM_OBJECTS: Final = {MARKER: markers_of, MARKERS: markers_of, TRANSFORMS: transforms_of}
"""Make the same arrays of the objects of another definition, such as that of an older ROS 2."""


class Decoder:
    """Decodes by the definitions of ROS 2 Jazzy, and by further ones, which take their place.

    definitions: fields of further types, as `rosbags.typesys` returns them.
    """

    def __init__(self, definitions: dict[str, Any]) -> None:
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
