"""The scene of the page: keeps what viser shows equal to a picture, and sends only what has changed.

viser keeps one pending value for each property and each browser, so a slow browser skips pictures and none queue up.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.view.levels import COLORS, Level
from collision_monitor.view.picture import InstanceBatch, Picture, Role

if TYPE_CHECKING:
    import viser

_OPACITY: Final = {Role.MOVING: None, Role.STATIC: 0.55, Role.IMPACT: 0.35}
_LIGHTS: Final = (("key", (-3.0, -4.0, 6.0), 1.8), ("fill", (4.0, 1.0, 2.0), 0.7))
"""Directional lights: name, where the light comes from, intensity. Weak enough that no colour turns white."""

_LINEAR: Final = np.round(255.0 * (np.arange(256) / 255.0) ** 2.2).astype(np.uint8)
_WHITE: Final = (255, 255, 255)
_TUBE: Final = (240, 200, 110)
_PLAN: Final = (90, 150, 230)

MOST_HIDDEN: Final = 64
"""Forms without objects that the browser keeps, because meshes come back to their poses of impact."""

Pick = Callable[[int], None]


class Page:
    """The scene. on_pick: called, on a thread of viser, with the id of an object that was clicked."""

    def __init__(self, server: viser.ViserServer, on_pick: Pick) -> None:
        self._server, self._scene, self._on_pick = server, server.scene, on_pick
        self._batches: dict[tuple[Role, str], Any] = {}
        self._ids: dict[tuple[Role, str], Any] = {}
        self._labels: dict[str, Any] = {}
        self._others: dict[str, Any] = {}
        self.hidden: set[str] = set()
        server.scene.set_up_direction("+z")
        server.scene.configure_default_lights(False)
        server.scene.configure_environment_map(None)
        server.scene.add_light_ambient("/lights/all around", intensity=1.2)
        for name, position, intensity in _LIGHTS:
            server.scene.add_light_directional(f"/lights/{name}", intensity=intensity, position=position)

    def show(self, picture: Picture) -> None:
        """Show a picture."""
        with self._server.atomic():
            self._hide_batches(picture)
            for key, batch in picture.batches.items():
                self._show_batch(key, batch)
            self._show_points(picture)
            self._show_lines(picture)
            self._show_mesh("tubes", picture.tubes, _TUBE, 0.25)
            self._show_mesh("plans", picture.ribbons, _PLAN, 0.4)
            self._show_labels(picture)

    # -- parts

    def _hide_batches(self, picture: Picture) -> None:
        """Hide the forms that nothing has any more. Remove the oldest, or forms that come and go would pile up."""
        hidden = [key for key in self._batches if key not in picture.batches]
        for key in hidden:
            self._batches[key].visible = False
        for key in hidden[: max(0, len(hidden) - MOST_HIDDEN)]:
            self._batches.pop(key).remove()
            del self._ids[key]

    def _show_batch(self, key: tuple[Role, str], batch: InstanceBatch) -> None:
        role, name = key
        self._ids[key] = batch.ids
        visible = role.value not in self.hidden
        handle = self._batches.get(key)
        if handle is None:
            form = batch.form
            handle = self._batches[key] = self._scene.add_batched_meshes_simple(
                f"/{role.value}/{name}",
                form.vertices,
                form.faces,
                batched_wxyzs=batch.wxyz,
                batched_positions=batch.position,
                batched_scales=batch.scale,
                batched_colors=_linear(batch.color),
                opacity=_OPACITY[role],
                flat_shading=form.flat,
                side="front" if form.closed else "double",
                lod="off",
                cast_shadow=False,
                receive_shadow=False,
                visible=visible,
            )
            if role is not Role.IMPACT:
                handle.on_click(lambda event: self._picked(key, event.instance_index))
            return
        handle.batched_positions, handle.batched_wxyzs = batch.position, batch.wxyz
        handle.batched_scales, handle.batched_colors = batch.scale, _linear(batch.color)
        handle.visible = visible

    def _picked(self, key: tuple[Role, str], instance: int | None) -> None:
        ids = self._ids[key]
        if instance is not None and 0 <= instance < len(ids):
            self._on_pick(int(ids[instance]))

    def _show_points(self, picture: Picture) -> None:
        white = np.tile(np.array(_WHITE, np.uint8), (len(picture.contacts), 1))
        self._points("contacts", picture.contacts, white, 0.12 * picture.unit)
        self._points("impacts", picture.impacts, picture.impact_colors, 0.14 * picture.unit)
        self._points("clouds", picture.clouds, picture.cloud_colors, picture.cloud_diameter)

    def _points(self, name: str, points: Any, colors: Any, size: float) -> None:
        handle = self._others.get(name)
        visible = len(points) > 0 and name not in self.hidden
        if handle is None and len(points):
            handle = self._others[name] = self._scene.add_point_cloud(
                f"/{name}", points, colors, point_size=size, point_shape="circle", precision="float32", visible=visible
            )
        elif handle is not None:
            handle.visible = visible
            if len(points):
                handle.points, handle.colors, handle.point_size = points, colors, size

    def _show_lines(self, picture: Picture) -> None:
        normals = np.tile(np.array(_WHITE, np.uint8), (*picture.normals.shape[:2], 1))
        self._lines("contacts/normals", picture.normals, normals, 3.0)
        self._lines("paths", picture.paths, _linear(picture.path_colors), 2.0)

    def _lines(self, name: str, points: Any, colors: Any, thickness: float) -> None:
        handle = self._others.get(name)
        visible = len(points) > 0 and name.partition("/")[0] not in self.hidden
        if handle is None and len(points):
            handle = self._others[name] = self._scene.add_line_segments(
                f"/lines/{name}", points, colors, thickness=thickness, thickness_units="screen", visible=visible
            )
        elif handle is not None:
            handle.visible = visible
            if len(points):
                handle.points, handle.colors = points, colors

    def _show_mesh(self, name: str, mesh: tuple[Any, Any], color: tuple[int, int, int], opacity: float) -> None:
        vertices, faces = mesh
        handle = self._others.get(name)
        visible = len(faces) > 0 and name not in self.hidden
        if handle is None and len(faces):
            self._others[name] = self._scene.add_mesh_simple(
                f"/{name}", vertices, faces, color=color, opacity=opacity, cast_shadow=False, receive_shadow=False,
                side="double" if name == "plans" else "front", visible=visible,
            )  # fmt: skip
        elif handle is not None:
            handle.visible = visible
            if len(faces):
                handle.vertices, handle.faces = vertices, faces

    def _show_labels(self, picture: Picture) -> None:
        """Keep one label for each key: a browser moves a label at once and writes a new text on it later."""
        labels = {each.key: each for each in picture.labels if "names" not in self.hidden}
        for key in self._labels.keys() - labels.keys():
            self._labels.pop(key).remove()
        for key, (_, text, place) in labels.items():
            handle = self._labels.get(key)
            if handle is None:
                self._labels[key] = self._scene.add_label(f"/names/{key}", text, position=place, anchor="bottom-center")
            else:
                handle.text, handle.position = text, place


def _linear(colors: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return sRGB colours as linear ones, which viser wants for instances and lines, but not for points."""
    return _LINEAR[colors]


def color_of(level: Level) -> tuple[int, int, int]:
    """Return the colour of a level."""
    red, green, blue = COLORS[level].tolist()
    return red, green, blue
