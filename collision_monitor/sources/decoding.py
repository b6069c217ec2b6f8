"""Message bytes to objects with the fields of the message, by the library rosbags, which needs no ROS."""

from __future__ import annotations

from typing import Any

from collision_monitor.errors import MessageError
from collision_monitor.sources.messages.autoware_bytes import HASHES, read_tracks


class Decoder:
    """Decodes by the definitions of ROS 2 Jazzy, and by further ones, which take their place.

    definitions: fields of further types, as `rosbags.typesys` returns them.
    """

    def __init__(self, definitions: dict[str, Any]) -> None:
        self.use(definitions)

    def use(self, definitions: dict[str, Any]) -> None:
        """Decode by these definitions and those of Jazzy from now on."""
        from rosbags.typesys import Stores, get_typestore

        self._checked: set[str] = set()
        self._types = get_typestore(Stores.EMPTY)
        self._types.register({**get_typestore(Stores.ROS2_JAZZY).fielddefs, **definitions})

    def define(self, message_type: str, text: str) -> None:
        """Add the definition of a type, and of those in it, in the form of rosbag2 (`ros2msg`)."""
        from rosbags.typesys import get_types_from_msg

        self._types.register(get_types_from_msg(text, message_type))
        self._types.get_msgdef(message_type)  # generates the code now, and not when the first message waits

    def __call__(self, message_type: str, data: bytes) -> Any:
        """Return the message. Raises MessageError."""
        if message_type in HASHES:
            return self._tracks(message_type, data)
        try:
            return self._types.deserialize_cdr(data, message_type)
        except Exception as error:  # the library raises one for each kind of damage
            reason = str(error) or type(error).__name__
            raise MessageError(f"expected a {message_type}, cannot be decoded: {reason}") from None

    def _tracks(self, message_type: str, data: bytes) -> Any:
        """Return tracks as arrays, if their definition has the layout for which `autoware_bytes` is written."""
        if message_type not in self._checked:
            found = self._types.hash_rihs01(message_type)
            if found != HASHES[message_type]:
                raise MessageError(f"expected a {message_type} with the type hash {HASHES[message_type]}, got {found}")
            self._checked.add(message_type)
        return read_tracks(data, message_type.endswith("PredictedObjects"))
