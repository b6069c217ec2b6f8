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


class RefusalWarning(UserWarning):
    """A step refused an input; the text says what was expected."""


class Refusal(Enum):
    """Reason for which the monitor refused an input; the status counts each as `refused_<value>`.

    >>> Refusal.TIME.value
    'time'
    """

    MALFORMED = "malformed"
    FRAME = "frame"
    TIME = "time"
    UNKNOWN_ID = "unknown_id"
    NON_FINITE = "non_finite"
    QUATERNION = "quaternion"
    OLD = "old"
    SHAPE = "shape"
