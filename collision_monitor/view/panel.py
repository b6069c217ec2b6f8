"""The panel of the page: the state, the time line, the list of pairs, what is shown, and the legend.

Callbacks run on threads of viser. They only put requests into a queue, which the loop of the view takes out.
"""

from __future__ import annotations

import html
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from collision_monitor.view.levels import ALERT_LEVELS, ANSWER_LEVELS, TEXTS, Level
from collision_monitor.view.moment import Moment
from collision_monitor.view.page import color_of
from collision_monitor.view.pair_list import PairRow
from collision_monitor.view.picture import ROWS, Picture

if TYPE_CHECKING:
    import viser

PARTS: Final = {
    "contacts": "contacts and normals",
    "impact": "poses of impact",
    "impacts": "places of impact",
    "paths": "predicted paths",
    "tubes": "tubes of uncertainty",
    "plans": "plans that objects follow",
    "names": "labels",
    "static": "objects that do not move",
}
"""What can be hidden: names of `Page.hidden`, and texts."""

WIDTH: Final = 400
"""Width of the panel with its margin (pixels of the page)."""

CORNER: Final = np.array([-0.9, -1.3, 1.3])
"""Direction from the scene to a new camera."""

WHOLE: Final = 2.0
"""Distance from which a camera sees the whole scene, in its radii."""

_CLEAR: Final = "no pair touches, and none is predicted to"
_UNKNOWN: Final = "not known: there are no answers"

Request = Callable[[], None]


class Panel:
    """The panel. requests: what the user wants, to be called by the view's loop. hidden: as of `Page`."""

    def __init__(self, server: viser.ViserServer, requests: SimpleQueue[Request], hidden: set[str]) -> None:
        self._server, self._requests, self._hidden = server, requests, hidden
        self._rows: list[PairRow] = []
        self._origin = np.zeros(3)
        self._extent = 1.0
        self._unit = 1.0
        self._last: dict[str, str] = {}
        gui = server.gui
        gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False, control_width="large")
        self._state = gui.add_html("")
        self._by_alerts = gui.add_checkbox("colour by alerts", True, visible=False)
        self._by_alerts.on_update(lambda _: requests.put(lambda: None))  # draws again

    def add_rest(self) -> None:
        """Add the parts below the time line, if there is one."""
        gui = self._server.gui
        with gui.add_folder("Soonest pairs"):
            self._buttons = [gui.add_button("–", visible=False) for _ in range(ROWS)]
            self._none = gui.add_html(_text(_CLEAR))
        for k, button in enumerate(self._buttons):
            button.on_click(partial(self._jump, k))
        with gui.add_folder("Object"):
            self._object = gui.add_html(_text("click an object"))
        with gui.add_folder("Show", expand_by_default=False):
            for name, text in PARTS.items():
                self._checkbox(name, text)
            home = gui.add_button("whole scene")
            home.on_click(lambda event: self._home(event.client))
        with gui.add_folder("Colours"):
            self._legend = gui.add_html(legend(alerts=False))

    def colours_by_alerts(self, moment: Moment) -> bool:
        """Return whether to colour by alerts. The choice is offered if the monitor has rules for them."""
        self._by_alerts.visible = moment.alerts is not None
        return moment.alerts is not None and self._by_alerts.value

    def show(self, picture: Picture, state: str, selected: str, *, alerts: bool) -> None:
        """Show the list of a picture, the state and the selected object, both as HTML."""
        self._rows, self._origin, self._unit = picture.rows, picture.origin, picture.unit
        self._extent, self._centre = picture.extent, picture.centre
        self._set(self._state, state)
        self._set(self._object, selected or _text("click an object"))
        self._set(self._legend, legend(alerts=alerts))
        for k, button in enumerate(self._buttons):
            button.visible = k < len(picture.rows)
            if k < len(picture.rows):
                button.label, button.color = picture.rows[k].text, color_of(picture.rows[k].level)
        self._none.visible = not picture.rows
        self._set(self._none, _text(_CLEAR if picture.is_known else _UNKNOWN))

    def _set(self, handle: Any, content: str) -> None:
        if handle.content != content:
            handle.content = content

    def _checkbox(self, name: str, text: str) -> None:
        box = self._server.gui.add_checkbox(text, name not in self._hidden)

        def change() -> None:
            (self._hidden.discard if box.value else self._hidden.add)(name)

        box.on_update(lambda _: self._requests.put(change))

    def _jump(self, k: int, event: Any) -> None:
        """Move the camera of the browser that clicked to a pair."""
        place = self._rows[k].place if k < len(self._rows) else None
        if place is not None and event.client is not None:
            look_at(event.client, place - self._origin, min(8.0 * self._unit, self._extent))

    def _home(self, client: Any) -> None:
        if client is not None:
            look_at(client, self._centre, WHOLE * self._extent)


def look_at(client: Any, place: Any, distance: float, direction: Any = None) -> None:
    """Move a camera towards a place. direction (3,): from the place to the camera; None: the side on which it is.

    The place is shown in the middle of what the panel leaves free.
    """
    camera, place = client.camera, np.asarray(place, np.float64)
    direction = camera.position - camera.look_at if direction is None else direction
    length = float(np.linalg.norm(direction))
    direction = direction / length if length > 0.0 else CORNER / np.linalg.norm(CORNER)
    if camera.image_width > 2 * WIDTH:
        right = np.cross((0.0, 0.0, 1.0), direction)
        pixel = 2.0 * distance * np.tan(0.5 * camera.fov) / camera.image_height
        place = place + 0.5 * WIDTH * pixel * right / max(float(np.linalg.norm(right)), 1e-9)
    with client.atomic():
        camera.position = place + distance * direction
        camera.look_at = place  # last, because a new position moves the point looked at


def legend(*, alerts: bool) -> str:
    """Return the legend as HTML."""
    lines = []
    for level in ALERT_LEVELS if alerts else ANSWER_LEVELS:
        red, green, blue = color_of(level)
        text = {Level.CLEAR: "no alert", Level.UNRESOLVED: "not known"}.get(level) if alerts else None
        lines.append(
            f'<div><span style="display:inline-block;width:.8em;height:.8em;border-radius:50%;margin-right:.5em;'
            f'background:rgb({red},{green},{blue})"></span>{html.escape(text or TEXTS[level])}</div>'
        )
    return f'<div style="font-size:.85em;padding:0 .9em .3em">{"".join(lines)}</div>'


def _text(content: str) -> str:
    return f'<div style="font-size:.85em;padding:0 .9em .3em;opacity:.7">{html.escape(content)}</div>'
