"""Messages of the packages in `interfaces/`, and scans, made with rosbags by the definitions there."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np
from foreign_bag import T, header, pose, vector
from ros_messages import definitions

from collision_monitor.sources import Decoder

AUTOWARE = "autoware_perception_msgs/msg/"
BOX, CYLINDER, POLYGON = 0, 1, 2


@cache
def decoder() -> Decoder:
    return Decoder(definitions())


def uuid(number: int) -> Any:
    return T["unique_identifier_msgs/msg/UUID"](np.frombuffer(number.to_bytes(16, "big"), np.uint8))


def polygon(points: Iterable[Iterable[float]]) -> Any:
    return T["geometry_msgs/msg/Polygon"]([T["geometry_msgs/msg/Point32"](*map(float, p)) for p in points])


def track(
    number: int,
    p: Any,
    q: Any = (0, 0, 0, 1),
    linear: Any = (0, 0, 0),
    angular: Any = (0, 0, 0),
    *,
    kind: int = BOX,
    size: Any = (4, 2, 1.5),
    footprint: Any = (),
    label: int = 1,
    existence: float = 0.9,
    pose_covariance: Any = None,
    twist_covariance: Any = None,
    orientation: int = 2,
    stationary: bool = False,
    acceleration: Any = (0, 0, 0),
    predicted: bool = False,
) -> Any:
    none = np.zeros(36)
    given = [none if c is None else np.asarray(c, np.float64).ravel() for c in (pose_covariance, twist_covariance)]
    twist = T["geometry_msgs/msg/Twist"](vector(linear), vector(angular))
    accel = T["geometry_msgs/msg/Accel"](vector(acceleration), vector((0, 0, 0)))
    parts = (
        T["geometry_msgs/msg/PoseWithCovariance"](pose(p, q), given[0]),
        T["geometry_msgs/msg/TwistWithCovariance"](twist, given[1]),
        T["geometry_msgs/msg/AccelWithCovariance"](accel, none),
    )
    shape = T[AUTOWARE + "Shape"](kind, polygon(footprint), vector(size))
    classes = [T[AUTOWARE + "ObjectClassification"](label, 0.8)]
    if predicted:
        kinematics = T[AUTOWARE + "PredictedObjectKinematics"](*parts, [])
        return T[AUTOWARE + "PredictedObject"](uuid(number), existence, classes, kinematics, shape)
    kinematics = T[AUTOWARE + "TrackedObjectKinematics"](*parts, orientation, stationary)
    return T[AUTOWARE + "TrackedObject"](uuid(number), existence, classes, kinematics, shape)


def tracked_objects(frame: str, stamp: int, *objects: Any) -> tuple[str, Any]:
    name = AUTOWARE + "TrackedObjects"
    return name, T[name](header(frame, stamp), list(objects))


def predicted_objects(frame: str, stamp: int, *objects: Any) -> tuple[str, Any]:
    name = AUTOWARE + "PredictedObjects"
    return name, T[name](header(frame, stamp), list(objects))


def detection(p: Any, size: Any = (1, 1, 1), *, name: str = "", label: str = "person", variance: float = 0.0) -> Any:
    hypothesis = T["vision_msgs/msg/ObjectHypothesis"](label, 0.9)
    covariance = np.diag([variance] * 6).ravel()
    where = T["geometry_msgs/msg/PoseWithCovariance"](pose(p), covariance)
    box = T["vision_msgs/msg/BoundingBox3D"](pose(p), vector(size))
    result = T["vision_msgs/msg/ObjectHypothesisWithPose"](hypothesis, where)
    return T["vision_msgs/msg/Detection3D"](header("", 0), [result], box, name)


def detections(frame: str, stamp: int, *each: Any) -> tuple[str, Any]:
    name = "vision_msgs/msg/Detection3DArray"
    return name, T[name](header(frame, stamp), list(each))


def footprint(frame: str, stamp: int, points: Any) -> tuple[str, Any]:
    name = "geometry_msgs/msg/PolygonStamped"
    return name, T[name](header(frame, stamp), polygon((*p, 0.0) for p in points))


def laser_scan(frame: str, stamp: int, ranges: Any, *, start: float = -1.0, step: float = 0.5) -> tuple[str, Any]:
    name = "sensor_msgs/msg/LaserScan"
    beams = np.asarray(ranges, np.float32)
    return name, T[name](header(frame, stamp), start, 0.0, step, 0.0, 0.1, 0.1, 10.0, beams, np.zeros(0, np.float32))


def point_cloud(frame: str, stamp: int, points: Any, *, gap: int = 4) -> tuple[str, Any]:
    """A cloud of float32 x, y, z with `gap` bytes behind each point."""
    name, field = "sensor_msgs/msg/PointCloud2", T["sensor_msgs/msg/PointField"]
    rows = np.zeros(len(points), np.dtype({"names": list("xyz"), "formats": ["<f4"] * 3, "offsets": [0, 4, 8], "itemsize": 12 + gap}))  # fmt: skip  # noqa: E501
    for axis, values in zip("xyz", np.asarray(points, np.float64).reshape(-1, 3).T, strict=True):
        rows[axis] = values
    fields = [field(axis, 4 * k, 7, 1) for k, axis in enumerate("xyz")]
    data = rows.view(np.uint8).reshape(-1)
    return name, T[name](
        header(frame, stamp), 1, len(points), fields, False, 12 + gap, (12 + gap) * len(points), data, False
    )


def occupancy_grid(
    frame: str, stamp: int, cells: Any, resolution: float = 0.5, p: Any = (0, 0, 0), q: Any = (0, 0, 0, 1)
) -> tuple[str, Any]:
    name, values = "nav_msgs/msg/OccupancyGrid", np.asarray(cells, np.int8)
    time = header(frame, stamp).stamp
    about = T["nav_msgs/msg/MapMetaData"](time, resolution, values.shape[1], values.shape[0], pose(p, q))
    return name, T[name](header(frame, stamp), about, values.ravel())


def occupancy_update(frame: str, stamp: int, row: int, column: int, cells: Any) -> tuple[str, Any]:
    name, values = "map_msgs/msg/OccupancyGridUpdate", np.asarray(cells, np.int8)
    return name, T[name](header(frame, stamp), column, row, values.shape[1], values.shape[0], values.ravel())


def costmap(frame: str, stamp: int, cells: Any, resolution: float = 0.5) -> tuple[str, Any]:
    name, values = "nav2_msgs/msg/Costmap", np.asarray(cells, np.uint8)
    time = header(frame, stamp).stamp
    about = T["nav2_msgs/msg/CostmapMetaData"](
        time, time, "", resolution, values.shape[1], values.shape[0], pose((0, 0, 0))
    )
    return name, T[name](header(frame, stamp), about, values.ravel())


def costmap_update(frame: str, stamp: int, row: int, column: int, cells: Any) -> tuple[str, Any]:
    name, values = "nav2_msgs/msg/CostmapUpdate", np.asarray(cells, np.uint8)
    return name, T[name](header(frame, stamp), column, row, values.shape[1], values.shape[0], values.ravel())


def octomap(frame: str, stamp: int, data: bytes, resolution: float = 0.1, *, binary: bool, id: str) -> tuple[str, Any]:
    name = "octomap_msgs/msg/Octomap"
    return name, T[name](header(frame, stamp), binary, id, resolution, np.frombuffer(data, np.int8))


def grid_map(frame: str, stamp: int, layers: dict[str, Any], resolution: float, at: Any, start: Any = (0, 0)) -> Any:
    """layers: heights (rows, columns) by name, as a grid_map::GridMap has them: row 0 at the greatest x."""
    name, data = "grid_map_msgs/msg/GridMap", []
    for heights in layers.values():
        rows, columns = heights.shape
        ring = np.roll(heights, start, (0, 1)).astype(np.float32)
        sizes = [("column_index", columns, rows * columns), ("row_index", rows, rows)]
        dims = [T["std_msgs/msg/MultiArrayDimension"](*each) for each in sizes]
        layout = T["std_msgs/msg/MultiArrayLayout"](dims, 0)
        data.append(T["std_msgs/msg/Float32MultiArray"](layout, ring.T.ravel()))
    about = T["grid_map_msgs/msg/GridMapInfo"](resolution, rows * resolution, columns * resolution, pose(at))
    return name, T[name](header(frame, stamp), about, list(layers), [], data, *start)
