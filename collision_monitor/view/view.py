"""The view: shows one moment after the other on the page."""

from __future__ import annotations

import time
from functools import partial
from queue import SimpleQueue
from typing import TYPE_CHECKING

import numpy as np

from collision_monitor.view.bodies import Floats
from collision_monitor.view.frames import RefusalLines
from collision_monitor.view.moment import Moment
from collision_monitor.view.page import Page
from collision_monitor.view.panel import CORNER, WHOLE, Panel, Request, look_at
from collision_monitor.view.picture import Picture, draw
from collision_monitor.view.state_text import object_html, state_html

if TYPE_CHECKING:
    import viser

GROWTH = 1.2
SETTLING = 5.0
"""s after the first objects in which the camera is set again if the scene grows by this factor: objects of several
topics get their poses one after the other."""

PERIOD = 0.05
"""Shortest time between two pictures (s). More than 20 a second show people no more."""


class View:
    """The page of one server. All but the callbacks of the browser runs on the caller's thread.

    panel: has its state on top; the caller adds the rest when the parts above are there. requests: what users want, to
    be called by the caller's loop. is_outdated: whether the last picture has to be drawn again.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self.requests: SimpleQueue[Request] = SimpleQueue()
        self._lines = RefusalLines()
        self._page = Page(server, on_pick=lambda object_id: self.requests.put(lambda: self._select(object_id)))
        self.panel = Panel(server, self.requests, self._page.hidden)
        self._selected: int | None = None
        self._origin: Floats | None = None
        self.is_outdated = True
        self._began = 0.0
        self._furnished, self._centre = 0.0, np.zeros(3)  # extent and centre for which the camera is set
        server.on_client_connect(lambda client: self.requests.put(partial(self._welcome, client)))

    @property
    def _is_new(self) -> bool:
        """Whether the scene may still lack objects, so that the camera has to follow its size."""
        return not self._furnished or time.monotonic() - self._began < SETTLING

    @property
    def is_watched(self) -> bool:
        """Whether a browser shows the page. Without one, nothing needs to be drawn."""
        return bool(self._server.get_clients())

    def answer_requests(self) -> None:
        """Do what users asked for since the last call."""
        while not self.requests.empty():
            request = self.requests.get()
            try:
                request()
            except Exception as error:  # a browser sent a value that no control of the page has
                self._lines.add(f"what a browser asked for: {error!r:.200}")
            self.is_outdated = True

    def show(self, moment: Moment, title: str, notes: list[str]) -> Picture:
        """Show a moment. title, notes: text above it."""
        alerts = self.panel.colours_by_alerts(moment)
        picture = draw(moment, origin=self._origin, selected=self._selected, alerts=alerts)
        if self._origin is None and len(moment.ids):
            self._origin = picture.origin
            self._began = time.monotonic()
        if self._origin is not None and picture.extent > GROWTH * self._furnished and self._is_new:
            self._furnished, self._centre = picture.extent, picture.centre
            self._furnish(picture)
        selected = "" if self._selected is None else object_html(moment, self._selected)
        if self._origin is not None and self._origin.any():
            notes = [*notes, "drawn about " + ", ".join(f"{value:g}" for value in self._origin) + " m"]
        with self._server.atomic():
            self._page.show(picture)
            self.panel.show(picture, state_html(title, moment, notes), selected, alerts=alerts)
        self.is_outdated = False
        return picture

    def _select(self, object_id: int) -> None:
        self._selected = object_id

    def _welcome(self, client: viser.ClientHandle) -> None:
        """Show a new browser the whole scene beside its panel; only the browser knows its size."""
        if self._furnished:
            look_at(client, self._centre, WHOLE * self._furnished, CORNER)

    def _furnish(self, picture: Picture) -> None:
        """Set the camera and the grid for a scene of this size."""
        extent, centre = picture.extent, picture.centre
        camera = self._server.initial_camera
        camera.look_at, camera.position = centre, centre + extent * CORNER
        camera.fov = np.radians(50.0)
        camera.near, camera.far = 1e-3 * extent, 50.0 * extent
        for client in self._server.get_clients().values():  # by the next picture, after viser's own first camera
            self.requests.put(partial(self._welcome, client))
        cell = 10.0 ** np.floor(np.log10(max(extent, 1e-6) / 3.0))
        self._server.scene.add_grid(
            "/grid", infinite_grid=True, cell_size=cell, section_size=5.0 * cell, fade_distance=12.0 * extent,
            cell_color=(70, 74, 80), section_color=(95, 100, 108), cell_thickness=0.6, section_thickness=1.0,
            position=(0.0, 0.0, -picture.origin[2] - 1e-3 * extent),
        )  # fmt: skip
