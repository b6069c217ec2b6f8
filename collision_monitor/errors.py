"""What can be wrong with what a user hands over, as an exception tree and as the reasons the monitor counts."""

from __future__ import annotations

from enum import Enum


class CollisionMonitorError(Exception):
    """Base of every error that this package raises on purpose; its text is meant for people."""


class InputError(CollisionMonitorError, ValueError):
    """An argument is not what was expected."""


class ShapeError(InputError):
    """A shape that cannot exist: negative, empty, flat where a solid is needed, indices out of range."""


class PoseError(InputError):
    """A pose or motion with non-finite numbers or a quaternion that is not of unit length."""


class UnsupportedError(CollisionMonitorError, NotImplementedError):
    """A pair, model or method that is not offered; the text lists what is."""


class ProfileError(InputError):
    """A setting with an unknown name or an impossible value; the text lists the choices."""


class MessageError(CollisionMonitorError):
    """Bytes that are not the message that was expected."""


class SessionError(CollisionMonitorError):
    """A recording that cannot be opened, read or written."""


class Refusal(Enum):
    """Why the monitor refused an input; each is counted in the status under `refused_<value>`."""

    MALFORMED = "malformed"
    FRAME = "frame"
    TIME = "time"
    UNKNOWN_ID = "unknown_id"
    NON_FINITE = "non_finite"
    QUATERNION = "quaternion"
    OLD = "old"
    SHAPE = "shape"
