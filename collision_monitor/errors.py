"""Exceptions of this package, and the reasons for which the monitor refuses an input."""

from __future__ import annotations

from enum import Enum
from typing import Final

LONGEST_ERROR: Final = 2000
"""Characters of an error: a value from a hostile file that it quotes can have a million."""


def one_line(text: str) -> str:
    """Return a text that may quote a file or a message as one line that can be shown, shortened in its middle.

    What it quotes can be neither a further line of a log, nor a control sequence of a terminal, nor half a letter.
    """
    if len(text) > LONGEST_ERROR:
        text = f"{text[: LONGEST_ERROR // 2]} [...] {text[-LONGEST_ERROR // 2 :]}"
    if text.isprintable():
        return text
    return "".join(it if it.isprintable() else it.encode("unicode_escape").decode() for it in text)


class CollisionMonitorError(Exception):
    """Base class of all errors that this package raises on purpose, with a text of one line for users."""

    def __str__(self) -> str:
        return one_line(super().__str__())


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
