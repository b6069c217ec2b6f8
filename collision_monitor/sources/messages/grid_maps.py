"""grid_map_msgs GridMap: a layer of heights as terrain, replaced by each message.

A layer is stored column by column in a ring: row 0 is at the greatest x, column 0 at the greatest y, from the start
indices on. (Fankhauser, Hutter, A universal grid map library, 2016)
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.shapes.kinds.height_field import MOST_HEIGHTS
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import HeightField
from collision_monitor.sources.ground.frames import FrameMotion
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.messages.map_source import MapSource, map_pose

GRID_MAP: Final = "grid_map_msgs/msg/GridMap"

COLUMN, ROW = "column_index", "row_index"
"""Labels of the dimensions of a layer."""


class GridMapSource(MapSource):
    """The terrain of one entry: heights of its `layer` at the centres of the cells, and the ground 1 m below them."""

    speaks = True

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        entry.allow_only(("layer", "unknown"), message_type)
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} brings its own heights")
        super().__init__(entry, {entry.topic: (message_type,)})

    def take_map(self, content: Any, frame: FrameMotion, scene: SourceScene) -> None:
        """See MapSource."""
        entry, about = self._entry, content.info
        heights, place = _heights(content, entry.layer), map_pose(about.pose)
        rows, columns = heights.shape
        resolution = float(about.resolution)
        field = HeightField(heights, resolution, unknown=entry.unknown)
        corner = Pose((-0.5 * (columns - 1) * resolution, -0.5 * (rows - 1) * resolution, 0.0))
        at = Pose(frame.position, frame.quaternion) @ place @ corner
        scene.describe(entry.describe(shapes=((field, Pose()),), at=at))


def _heights(content: Any, layer: str) -> NDArray[np.float64]:
    """Heights (y, x) of a layer in m, from the least x and y on. Raises InputError."""
    names = [str(name) for name in content.layers]
    if layer not in names or len(content.data) != len(names):
        raise InputError(f"layers: expected {layer!r} and data of each, got {', '.join(names)[:100] or 'none'}")
    array = content.data[names.index(layer)]
    sizes = {str(dim.label): int(dim.size) for dim in array.layout.dim}
    if [str(dim.label) for dim in array.layout.dim] != [COLUMN, ROW]:
        raise InputError(f"layout: expected the dimensions {COLUMN}, {ROW}, got {', '.join(sizes)[:100] or 'none'}")
    columns, rows = sizes[COLUMN], sizes[ROW]
    if not (rows >= 2 and columns >= 2 and rows * columns <= MOST_HEIGHTS):
        raise InputError(
            f"layout: expected 2 x 2 to {MOST_HEIGHTS} cells, got {rows} x {columns}; what was there stays"
        )
    if len(array.data) != rows * columns:
        raise InputError(f"data: expected {rows * columns} heights for {rows} x {columns}, got {len(array.data)}")
    start = int(content.outer_start_index), int(content.inner_start_index)
    if not (start[0] < rows and start[1] < columns):
        raise InputError(f"start index: expected less than {rows}, {columns}, got {start[0]}, {start[1]}")
    ring = np.asarray(array.data, np.float64).reshape(columns, rows).T
    whole = np.roll(ring, (-start[0], -start[1]), (0, 1))
    whole[np.isinf(whole)] = np.nan
    return np.ascontiguousarray(whole[::-1, ::-1].T)
