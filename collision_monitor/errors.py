"""Exceptions of this package, and the reasons for which the monitor refuses an input."""

from __future__ import annotations

from enum import Enum


class CollisionMonitorError(Exception):
    """Base class of all errors that this package raises on purpose, with a text for users."""


class InputError(CollisionMonitorError, ValueError):
    """An argument is invalid."""


class ShapeError(InputError):
    """A shape is impossible: negative or empty, flat instead of solid, or with indices out of range."""


class PoseError(InputError):
    """A pose or motion has non-finite numbers or a quaternion that is not of unit length."""


class UnsupportedError(CollisionMonitorError, NotImplementedError):
    """A pair, model or method is not supported; the text lists the supported ones."""


class ProfileError(InputError):
    """A setting has an unknown name or an impossible value; the text lists the choices."""


class MessageError(CollisionMonitorError):
    """The bytes are not the expected message."""


class SessionError(CollisionMonitorError):
    """A recording cannot be opened, read or written."""


def reason_of(error: Exception) -> str:
    """Return the text with which one object of a message is refused, so that the others go on.

    Our own errors have a text for users. Every other exception is an error in this program or in a library below it
    (LinAlgError, OverflowError, ZeroDivisionError, IndexError, …) or a lack of memory or stack (MemoryError,
    RecursionError). A monitor must not end for any of them, because the topic is latched and the next one would
    receive the same message. The text names the type. KeyboardInterrupt and SystemExit are no Exception.
    """
    if isinstance(error, CollisionMonitorError):
        return str(error)
    return f"it cannot be monitored, for an unexpected {type(error).__name__}: {error!s:.200}; please report it"


class TooCostlyError(CollisionMonitorError):
    """A computation exceeds the limit that its caller set (`orientation.exact_limit`)."""


class Refusal(Enum):
    """Reason for which the monitor refused an input; the status counts each as `refused_<value>`."""

    MALFORMED = "malformed"
    FRAME = "frame"
    TIME = "time"
    UNKNOWN_ID = "unknown_id"
    NON_FINITE = "non_finite"
    QUATERNION = "quaternion"
    OLD = "old"
    SHAPE = "shape"
