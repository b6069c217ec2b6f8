"""nav_msgs OccupancyGrid and nav2_msgs Costmap, with their updates: a plane grid of cells as static objects."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.shapes.kinds.grid import FREE, MOST_CELLS, OCCUPIED, OCCUPIED_FROM, UNKNOWN
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Grid
from collision_monitor.sources.ground.frames import FrameMotion, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.messages.map_source import MapSource, map_pose
from collision_monitor.tolerances import LARGEST_INPUT

GRID: Final = "nav_msgs/msg/OccupancyGrid"
GRID_UPDATE: Final = "map_msgs/msg/OccupancyGridUpdate"
COSTMAP: Final = "nav2_msgs/msg/Costmap"
COSTMAP_UPDATE: Final = "nav2_msgs/msg/CostmapUpdate"

UPDATES: Final = {GRID: GRID_UPDATE, COSTMAP: COSTMAP_UPDATE}
"""The type of the updates of each type of grid."""

LETHAL: Final = 254.0
"""Least cost of an occupied cell of a Costmap by default: 253 says only that the robot's centre must not be there."""

NO_INFORMATION: Final = 255
"""Cost of an unknown cell of a Costmap."""

HEIGHT: Final = 2.0
"""Height of the columns by default (m)."""

Cells = NDArray[np.uint8]


class CellWindow(NamedTuple):
    """Values of cells (rows, columns) from a row and a column on: FREE, OCCUPIED or UNKNOWN."""

    row: int
    column: int
    cells: Cells


class GridSource(MapSource):
    """The map of one entry: its occupied cells as one object; its unknown ones as another one, whose contacts are
    UNRESOLVED, unless `unknown` says that they are obstacles or free.

    Two objects, because what is certain of the one is certain also where it is not known of the other.
    """

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        entry.allow_only(("height", "threshold", "unknown", "updates"), message_type)
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} brings its own cells; `height` is theirs")
        updates = {entry.updates: (UPDATES[message_type],)} if entry.updates else {}
        super().__init__(entry, {entry.topic: (message_type,), **updates})
        self._is_cost = message_type == COSTMAP
        self._least = entry.threshold or (LETHAL if self._is_cost else OCCUPIED_FROM)
        self._cells: Cells | None = None
        self._place = 0.0, Pose()  # resolution (m), and the pose of the grid in its frame
        self._frame = ""
        self._grids: dict[int, Grid | None] = {}  # by what cells are
        self._unknown_id: int | None = None

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source. An update replaces some cells."""
        if topic == self._entry.topic:
            super().take(topic, content, stamp_ns, scene)
            return
        name = frame_name(content.header.frame_id)
        frame = scene.locate(self.name, name, stamp_ns)
        if frame is not None:
            self._describe(frame, self._part(content, name), scene)

    def take_map(self, content: Any, frame: FrameMotion, scene: SourceScene) -> None:
        """See MapSource."""
        self._cells, self._place = self._whole(content)
        self._frame, self._grids = frame_name(content.header.frame_id), {}
        self._describe(frame, None, scene)

    def _whole(self, content: Any) -> tuple[Cells, tuple[float, Pose]]:
        """The cells of a message, their resolution and pose. Raises InputError, PoseError."""
        about = content.metadata if self._is_cost else content.info
        size = (about.size_x, about.size_y) if self._is_cost else (about.width, about.height)
        resolution = float(about.resolution)
        if not 0.0 < resolution <= LARGEST_INPUT:
            raise InputError(
                f"resolution: expected a positive number of metres, got {resolution:g}; what was there stays"
            )
        place = map_pose(about.origin)
        return self._values(content.data, *map(int, size)).copy(), (resolution, place)

    def _part(self, content: Any, frame: str) -> CellWindow:
        """Take the cells of an update. Raises InputError."""
        if self._cells is None:
            raise InputError("update: expected a whole map before, got none; it is left out")
        if frame != self._frame:
            raise InputError(f"update: expected the frame of the map, {self._frame!r}, got {frame!r}")
        size = (content.size_x, content.size_y) if self._is_cost else (content.width, content.height)
        values = self._values(content.data, *map(int, size))
        row, column = int(content.y), int(content.x)
        rows, columns = self._cells.shape
        if not (0 <= row <= rows - len(values) and 0 <= column <= columns - values.shape[1]):
            raise InputError(
                f"update: expected cells within {columns} x {rows}, got {size[0]} x {size[1]} from {column}, {row} on"
            )
        self._cells[row : row + len(values), column : column + values.shape[1]] = values
        return CellWindow(row, column, values)

    def _values(self, data: Any, width: int, height: int) -> Cells:
        """FREE, OCCUPIED or UNKNOWN for each cell (height, width). Raises InputError."""
        if not 1 <= width * height <= MOST_CELLS:
            raise InputError(
                f"width, height: expected 1 to {MOST_CELLS} cells, got {width} x {height}; what was there stays"
            )
        if len(data) != width * height:
            raise InputError(
                f"data: expected {width * height} cells for {width} x {height}, got {len(data)}; what was there stays"
            )
        given = np.asarray(data).view(np.uint8 if self._is_cost else np.int8)
        values = np.where(given >= self._least, OCCUPIED, FREE).astype(np.uint8)
        values[given == NO_INFORMATION if self._is_cost else given < 0] = UNKNOWN
        return values.reshape(height, width)

    def _describe(self, frame: FrameMotion, changed: CellWindow | None, scene: SourceScene) -> None:
        entry, at = self._entry, Pose(frame.position, frame.quaternion) @ self._place[1]
        kinds = {OCCUPIED: (OCCUPIED, UNKNOWN) if entry.unknown == "obstacle" else (OCCUPIED,)}
        if entry.unknown == "unresolved":
            kinds[UNKNOWN] = (UNKNOWN,)
            self._unknown_id = scene.new_id() if self._unknown_id is None else self._unknown_id
        for kind, values in kinds.items():
            grid = self._grids[kind] = self._grid(kind, values, changed)
            is_map = kind == OCCUPIED
            object_id = entry.object_id if is_map or self._unknown_id is None else self._unknown_id
            if grid is None:
                scene.remove(object_id)
                continue
            name = entry.name if is_map else f"{entry.name}/unknown"
            scene.describe(entry.describe(object_id, name, ((grid, Pose()),), at=at))

    def _grid(self, kind: int, values: tuple[int, ...], changed: CellWindow | None) -> Grid | None:
        """The grid of the cells with some values; None if there are none. Of unknown cells, it is UNRESOLVED."""
        assert self._cells is not None
        code = -1 if kind == UNKNOWN else 100
        known = self._grids.get(kind)
        if known is not None and changed is not None:
            part = np.where(np.isin(changed.cells, values), code, 0)
            if part.any() or _has_others(known, changed):
                return known.updated(changed.row, changed.column, part)
            return None
        cells = np.where(np.isin(self._cells, values), np.int8(code), np.int8(0))
        return Grid(cells, self._place[0], self._entry.height or HEIGHT) if cells.any() else None


def _has_others(grid: Grid, changed: CellWindow) -> bool:
    """Whether a grid has cells that may be there outside of a window."""
    rows, columns = changed.cells.shape
    within = grid.cells[changed.row : changed.row + rows, changed.column : changed.column + columns]
    return bool(np.count_nonzero(grid.cells) > np.count_nonzero(within))
