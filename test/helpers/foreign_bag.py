"""Bags like those of other programs, written with rosbags: odometry, poses, transforms and markers."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from ros_messages import SECOND, store
from rosbags.rosbag2 import StoragePlugin, Writer

STORE = store()
T = STORE.types
START = 1_700_000_000 * SECOND


def time(stamp: int) -> Any:
    return T["builtin_interfaces/msg/Time"](stamp // SECOND, stamp % SECOND)


def header(frame: str, stamp: int) -> Any:
    return T["std_msgs/msg/Header"](time(stamp), frame)


def vector(v: Iterable[float]) -> Any:
    return T["geometry_msgs/msg/Vector3"](*map(float, v))


def pose(p: Iterable[float], q: Iterable[float] = (0, 0, 0, 1)) -> Any:
    point = T["geometry_msgs/msg/Point"](*map(float, p))
    return T["geometry_msgs/msg/Pose"](point, T["geometry_msgs/msg/Quaternion"](*map(float, q)))


def odometry(frame: str, stamp: int, p: Any, q: Any, linear: Any, angular: Any) -> tuple[str, Any]:
    twist = T["geometry_msgs/msg/Twist"](vector(linear), vector(angular))
    none = np.zeros(36)
    with_pose = T["geometry_msgs/msg/PoseWithCovariance"](pose(p, q), none)
    with_twist = T["geometry_msgs/msg/TwistWithCovariance"](twist, none)
    return "nav_msgs/msg/Odometry", T["nav_msgs/msg/Odometry"](header(frame, stamp), "base", with_pose, with_twist)


def pose_stamped(frame: str, stamp: int, p: Any, q: Any = (0, 0, 0, 1)) -> tuple[str, Any]:
    return "geometry_msgs/msg/PoseStamped", T["geometry_msgs/msg/PoseStamped"](header(frame, stamp), pose(p, q))


def transforms(stamp: int, *links: tuple[str, str, Any, Any]) -> tuple[str, Any]:
    """TFMessage of links (parent, child, position, quaternion)."""
    each = [
        T["geometry_msgs/msg/TransformStamped"](
            header(parent, stamp),
            child,
            T["geometry_msgs/msg/Transform"](vector(p), T["geometry_msgs/msg/Quaternion"](*map(float, q))),
        )
        for parent, child, p, q in links
    ]
    return "tf2_msgs/msg/TFMessage", T["tf2_msgs/msg/TFMessage"](each)


def marker(
    namespace: str, number: int, kind: int, scale: Any, p: Any, *, frame: str, stamp: int, action: int = 0
) -> Any:
    color = T["std_msgs/msg/ColorRGBA"](1.0, 0.5, 0.0, 1.0)
    image = T["sensor_msgs/msg/CompressedImage"](header("", 0), "", np.zeros(0, np.uint8))
    return T["visualization_msgs/msg/Marker"](
        header(frame, stamp), namespace, number, kind, action, pose(p), vector(scale), color,
        T["builtin_interfaces/msg/Duration"](0, 0), False, [], [], "", image, [], "label", "",
        T["visualization_msgs/msg/MeshFile"]("", np.zeros(0, np.uint8)), False,
    )  # fmt: skip


def markers(*each: Any) -> tuple[str, Any]:
    return "visualization_msgs/msg/MarkerArray", T["visualization_msgs/msg/MarkerArray"](list(each))


def write_bag(
    path: Path, messages: Iterable[tuple[str, int, tuple[str, Any]]], *, storage: StoragePlugin = StoragePlugin.MCAP
) -> Path:
    """Write messages (topic, time of receipt in ns, (type, message or its bytes)) into a bag; returns its path."""
    connections: dict[str, Any] = {}
    with Writer(path, version=9, storage_plugin=storage) as writer:
        for topic, received, (kind, message) in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            data = message if isinstance(message, bytes) else STORE.serialize_cdr(message, kind)
            writer.write(connections[topic], received, data)
    return path
