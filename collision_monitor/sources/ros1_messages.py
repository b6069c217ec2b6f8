"""Messages of ROS 1 as those of ROS 2: the type of the same name, encoded as CDR. The library rosbags knows both forms.

A field that only ROS 2 has gets its default; one that only ROS 1 has, such as `seq` of a header, is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from collision_monitor.errors import SessionError

ROS1: Final = "ros1"
"""How the messages of ROS 1 are encoded, by the name that MCAP has for it."""

_RENAMED: Final = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}


def ros2_name(name: str) -> str:
    """Return the name of a type as ROS 2 writes it, such as `nav_msgs/msg/Odometry`."""
    package, _, rest = name.partition("/")
    full = name if "/" in rest or not rest else f"{package}/msg/{rest}"
    return _RENAMED.get(full, full)


class Ros1Converter:
    """Converts the messages of one type. definition: of the type in ROS 1, with those of the types in it.

    Raises SessionError if the definition cannot be read.
    """

    def __init__(self, name: str, definition: str) -> None:
        try:
            self._convert = _converter(name, definition)
        except Exception as error:  # the library raises one for each kind of damage
            raise SessionError(f"{name}: expected a definition of a message, got: {error!s:.200}") from None

    def __call__(self, data: bytes) -> bytes:
        """Return the CDR bytes of a message; none for a message that is damaged, which no decoder takes."""
        try:
            return bytes(self._convert(data))
        except Exception:  # likewise
            return b""


def _converter(name: str, definition: str) -> Callable[[bytes], Any]:
    from rosbags.convert.converter import is_same_wireformat, migrate_bytes
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    ours = get_typestore(Stores.ROS2_JAZZY)
    theirs = get_typestore(Stores.EMPTY)
    theirs.register(get_types_from_msg(definition, name))
    if name not in ours.fielddefs:  # a type of another package: as ROS 1 defines it, but for the header
        own = {each: fields for each, fields in theirs.fielddefs.items() if each not in ours.fielddefs}
        ours = get_typestore(Stores.EMPTY)
        ours.register({**get_typestore(Stores.ROS2_JAZZY).fielddefs, **own})
    if is_same_wireformat(theirs, ours, name, name):
        return lambda data: ours.ros1_to_cdr(data, name)
    cache: dict[str, Any] = {}
    return lambda data: migrate_bytes(theirs, ours, name, name, cache, data, src_is2=False, dst_is2=True)
