"""sensor_msgs LaserScan and PointCloud2: the points of a scan as one static object, replaced by each message.

A scan holds no speeds, and its points are taken as of one time. The pose of the sensor's frame at the message's stamp
places them in the monitor's frame.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.query.points.points_within import points_within
from collision_monitor.shapes.kinds.points import MOST_CLOUD_POINTS
from collision_monitor.shapes.pose import Pose, rotation_matrix
from collision_monitor.shapes.registry import Points, Sphere, Voxels
from collision_monitor.sources.ground.frames import FrameMotion, frame_name
from collision_monitor.sources.ground.mapping import Mapping
from collision_monitor.sources.ground.object_entry import ObjectEntry
from collision_monitor.sources.ground.source import Source
from collision_monitor.sources.ground.source_scene import SourceScene
from collision_monitor.sources.ground.yaml_table import known
from collision_monitor.sources.messages.ground_points import above_ground
from collision_monitor.sources.messages.laser_scans import MOST_HELD, SCAN, BeamMemory, read_beams
from collision_monitor.tolerances import LARGEST_INPUT

__all__ = ["CLOUD", "SCAN", "CloudSource", "read_cloud_points", "thinned"]

CLOUD: Final = "sensor_msgs/msg/PointCloud2"

Floats = NDArray[np.float64]

MOST_POINTS: Final = 4 * MOST_CLOUD_POINTS
"""Points of a message, before those without a place are dropped and the others are thinned."""

KEYS: Final = "radius", "voxel", "min_range", "max_range", "without", "clearance", "nan_is_free"
GROUND_KEYS: Final = "voxels", "frame", "min_height", "max_height", "ground_slope", "ground_thickness"
"""Keys of an entry, and further ones of a PointCloud2."""

_FORMATS: Final = {7: ("f4", 4), 8: ("f8", 8)}
"""NumPy's names of PointField's float types, and their bytes."""


class CloudSource(Source):
    """The scan of one entry: points of the entry's `radius`, thinned to one for each cube of its `voxel`, or `voxels`.

    Points on the objects that `without` names are left out: those of the robot that carries the sensor. A scan that
    measured nothing is refused, and what the last one saw stays: a failed sensor does not make free space.
    """

    def __init__(self, entry: ObjectEntry, message_type: str, mapping: Mapping) -> None:
        entry.allow_only((*KEYS, *(GROUND_KEYS if message_type == CLOUD else ())), message_type)
        if entry.voxels and not entry.voxel:
            raise InputError(f"{entry.name}, voxel: expected the edge of the voxels in m, got none")
        if not entry.ground_slope < 90.0:
            raise InputError(f"{entry.name}, ground_slope: expected less than 90 deg, got {entry.ground_slope:g}")
        if entry.shapes:
            raise InputError(f"{entry.name}, shape: {message_type} brings its own points; `radius` is theirs")
        for each in entry.without:
            known(each, [*(other.name for other in mapping.sources), *mapping.robots], f"{entry.name}, without")
        self.name, self.topics = entry.name, {entry.topic: (message_type,)}
        self._entry = entry
        self._memory = BeamMemory()
        if entry.without:  # load the kernel before messages arrive
            points_within(Points(np.zeros((1, 3)), 0.1), Pose(), ((Sphere(1.0), Pose()),), Pose(), 0.0)

    def take(self, topic: str, content: Any, stamp_ns: int, scene: SourceScene) -> None:
        """See Source. The first scan describes the object."""
        entry = self._entry
        frame = scene.locate(entry.name, frame_name(content.header.frame_id), stamp_ns)
        if frame is None:
            return
        points, lost = self._cloud(content) if hasattr(content, "point_step") else self._scan(content, frame, scene)
        scene.points_dropped[entry.name] += lost
        points = self._without_ground(points, frame, stamp_ns, scene)
        cells = _cells(points, entry.voxel) if entry.voxels else None
        if cells is None:
            points, radius = thinned(points, entry.voxel, entry.radius)
        else:
            points, radius = entry.voxel * (cells.astype(np.float64) + 0.5), 0.5 * math.sqrt(3.0) * entry.voxel
        if not len(points):  # nothing is there, as far as the scan says
            scene.remove(entry.object_id)
            return
        cloud, at = Points(points, radius), Pose(frame.position, frame.quaternion)
        kept = ~self._on_robot(cloud, at, stamp_ns, scene)
        if not kept.any():
            scene.remove(entry.object_id)
            return
        if not kept.all():
            cloud = Points(points[kept], radius)
        shape = cloud if cells is None else Voxels(cells[kept], entry.voxel)
        scene.describe(entry.describe(shapes=((shape, Pose()),), at=at))

    def restart(self, now_ns: int, scene: SourceScene) -> None:
        """See Source. The scanner may be elsewhere now, and what it saw not be there."""
        self._memory.restart()

    def _scan(self, scan: Any, frame: FrameMotion, scene: SourceScene) -> tuple[Floats, int]:
        """Return the points of a LaserScan and of its failed beams, and the number of the latter. Raises InputError."""
        beams = read_beams(scan, nan_is_free=self._entry.nan_is_free, nearest=self._entry.min_range)
        used = beams.met & self._within(beams.points)
        beams = beams._replace(reach=min(beams.reach, self._entry.max_range))
        held, forgotten = self._memory.stays(beams, frame_name(scan.header.frame_id), frame, used)
        if forgotten:
            text = f"expected at most {MOST_HELD} points of beams that failed, got more; the farthest are forgotten"
            scene.refuse(self.name, text, forgotten)
        return np.concatenate([beams.points[used], held]), int(np.count_nonzero(beams.failed))

    def _cloud(self, cloud: Any) -> tuple[Floats, int]:
        """Return the points of a PointCloud2 and the number of those without a place. Raises InputError."""
        points, lost = read_cloud_points(cloud)
        least = self._entry.min_range
        # the sensor is in none of its points: drivers write 0 for what they did not measure
        near = int(np.count_nonzero(_squared(points) < least**2)) if points.any() else len(points)
        if near == len(points) and (near or (lost and not self._entry.nan_is_free)):  # which says nothing of free space
            expected = f"finite ones beyond {least:g} m" if near else "finite ones"
            raise InputError(f"points: expected {expected}, got none of {len(points) + lost}; what was there stays")
        return points[self._within(points)], lost

    def _without_ground(self, points: Floats, frame: FrameMotion, stamp_ns: int, scene: SourceScene) -> Floats:
        """The points that are no ground, by their heights in the entry's frame. Raises InputError if tf lacks it."""
        entry = self._entry
        if not (entry.ground_slope or {"min_height", "max_height"} & set(entry.given)):
            return points
        placed = points @ rotation_matrix(frame.quaternion).T + frame.position
        if entry.frame and entry.frame != scene.frame:
            level = scene.frames.motion(scene.frame, entry.frame, stamp_ns)
            if not isinstance(level, FrameMotion):
                raise InputError(f"frame: {level}; what was there stays")
            placed = (placed - level.position) @ rotation_matrix(level.quaternion)
        low = entry.min_height if "min_height" in entry.given else -LARGEST_INPUT
        return points[above_ground(placed, (low, entry.max_height), entry.ground_slope, entry.ground_thickness)]

    def _within(self, points: Floats) -> NDArray[np.bool_]:
        """Which points (N,) are within the entry's range of the sensor."""
        squared = _squared(points)
        return np.asarray((squared >= self._entry.min_range**2) & (squared <= self._entry.max_range**2))

    def _on_robot(self, cloud: Points, at: Pose, stamp_ns: int, scene: SourceScene) -> NDArray[np.bool_]:
        """Which points (N,) are on an object that is left out. Raises InputError if it is not known where one is."""
        on = np.zeros(len(cloud.points), np.bool_)
        for name in self._entry.without:
            objects = scene.placed(name, stamp_ns)
            if not objects:
                raise InputError(f"without: the pose of {name} is not known at the stamp of this scan")
            for description, pose in objects:
                limit = self._entry.clearance + description.padding
                on |= points_within(cloud, at, description.shapes, pose, limit)
        return on


def _cells(points: Floats, edge: float) -> NDArray[np.int32]:
    """The cells (n, 3) of an edge (m) that hold points (N, 3), of a lattice at the origin. Raises InputError."""
    cells = np.floor(points / edge)
    if not (np.abs(cells) < 1 << 30).all():
        raise InputError(f"voxel: expected cells whose numbers are below 2^30, got smaller cells of {edge:g} m")
    return np.unique(cells.astype(np.int32), axis=0)


def read_cloud_points(cloud: Any) -> tuple[Floats, int]:
    """Return the points (N, 3) in m of a PointCloud2 in its frame, and the number of those that are nowhere.

    Raises InputError if it has no x, y and z.
    """
    fields = {each.name: each for each in cloud.fields}
    missing = [name for name in "xyz" if name not in fields or fields[name].datatype not in _FORMATS]
    if missing:
        there = ", ".join(f"{each.name:.20} ({each.datatype})" for each in cloud.fields[:20]) or "none"
        raise InputError(f"fields: expected x, y and z of FLOAT32 (7) or FLOAT64 (8), got {there}")
    count = int(cloud.width) * int(cloud.height)
    if count > MOST_POINTS:
        raise InputError(f"expected at most {MOST_POINTS} points, got {count}")
    data = np.asarray(cloud.data, np.uint8)
    if count == 0 and len(data):
        raise InputError(f"width, height: expected the points of {len(data)} bytes, got none")
    if count == 0:
        return np.zeros((0, 3)), 0
    least = int(cloud.width) * int(cloud.point_step)
    if cloud.row_step < least or len(data) < int(cloud.height) * int(cloud.row_step):
        raise InputError(
            f"data: expected {cloud.height} rows of {least} bytes, got row_step {cloud.row_step} and {len(data)} bytes"
        )
    order = ">" if cloud.is_bigendian else "<"
    formats, offsets = [], []
    for name in "xyz":  # before NumPy sees them: it believes any offset
        kind, size = _FORMATS[fields[name].datatype]
        if not 0 <= fields[name].offset <= cloud.point_step - size:
            raise InputError(
                f"fields: expected {name} within point_step {cloud.point_step}, got {size} bytes "
                f"at offset {fields[name].offset}"
            )
        formats.append(order + kind)
        offsets.append(int(fields[name].offset))
    dtype = np.dtype(
        {"names": ["x", "y", "z"], "formats": formats, "offsets": offsets, "itemsize": int(cloud.point_step)}
    )
    rows = data[: cloud.height * cloud.row_step].reshape(cloud.height, cloud.row_step)[:, :least]
    raw = np.ascontiguousarray(rows).reshape(-1).view(dtype)
    points = np.empty((count, 3))
    with np.errstate(invalid="ignore"):  # a signalling NaN
        for k, name in enumerate("xyz"):
            points[:, k] = raw[name]
        finite = (np.abs(points) <= LARGEST_INPUT).all(1)
    return (points, 0) if finite.all() else (points[finite], int(count - np.count_nonzero(finite)))


def _squared(points: Floats) -> Floats:
    """Return the squared distances (N,) of points from the sensor, infinite for those beyond all numbers."""
    with np.errstate(over="ignore"):
        return np.asarray((points**2).sum(1))


def thinned(points: Floats, voxel: float, radius: float) -> tuple[Floats, float]:
    """Return the centres of the cubes of edge `voxel` (m) that hold points, and a radius that holds the points' balls.

    voxel 0: the points and the radius themselves.
    """
    if not voxel or not len(points):
        return points, radius
    low = points.min(0)
    cells = np.floor((points - low) / voxel)
    extent = cells.max(0) + 1.0
    if extent.prod() >= 2.0**62:  # a cube has no number then
        return points, radius
    whole, size = cells.astype(np.int64), extent.astype(np.int64)
    numbers = (whole[:, 0] * size[1] + whole[:, 1]) * size[2] + whole[:, 2]
    _, first = np.unique(numbers, return_index=True)
    return low + (cells[np.sort(first)] + 0.5) * voxel, radius + 0.5 * math.sqrt(3.0) * voxel
