"""What a browser may send: where its camera is, which object was clicked, and new values of the controls.

viser takes more: its messages may set any attribute of a control, upload files, or ask for a public address of the
page. It ends a connection with a traceback for bytes that are no message. Here each of them costs one line.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from math import isfinite
from typing import Any, Final

LONGEST: Final = 1000
"""Characters of a value."""

MOST_LINES: Final = 20
"""Lines about refusals that are printed; a page that sends nothing else would fill the terminal."""

Check = Callable[[Any], bool]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value) and abs(value) < 1e18


def _are_numbers(count: int) -> Check:
    return lambda value: isinstance(value, list | tuple) and len(value) == count and all(map(_is_number, value))


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= LONGEST


def _is_update(value: Any) -> bool:
    """Whether only the value of a control changes, and viser can convert it."""
    if not (isinstance(value, dict) and set(value) == {"value"}):
        return False
    new = value["value"]
    return isinstance(new, bool) or _is_number(new) or _is_text(new)


_FIELDS: Final[dict[str, dict[str, Check]]] = {
    "ViewerCameraMessage": {
        "wxyz": _are_numbers(4),
        "position": _are_numbers(3),
        "look_at": _are_numbers(3),
        "up_direction": _are_numbers(3),
        **dict.fromkeys(("fov", "near", "far", "image_height", "image_width"), _is_number),
    },
    "GuiUpdateMessage": {"uuid": _is_text, "updates": _is_update},
    "SceneNodeClickMessage": {
        "name": _is_text,
        "instance_index": lambda value: value is None or (_is_number(value) and isinstance(value, int)),
    },
}
"""The messages that are taken, with what is expected of their fields."""


def refused_frame(message: Any) -> str:
    """Return why a message of a browser is not taken; empty if it is."""
    name = type(message).__name__
    if name not in _FIELDS:
        return f"a message {name:.80}, which this page does not use"
    for field, check in _FIELDS[name].items():
        value = getattr(message, field, None)
        if not check(value):
            return f"a {name} with {field} {value!r:.80}"
    return ""


class RefusalLines:
    """Prints what is refused on stderr, one line each, up to MOST_LINES."""

    def __init__(self) -> None:
        self._count = 0

    def add(self, text: str) -> None:
        """Print a line."""
        self._count += 1
        if self._count <= MOST_LINES:
            more = "; further ones are not listed" if self._count == MOST_LINES else ""
            print(f"view: refused {' '.join(text.split())}{more}", file=sys.stderr, flush=True)
