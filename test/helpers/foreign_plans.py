"""Messages with plans of other programs, for tests."""

from __future__ import annotations

from typing import Any

from foreign_bag import START, STORE, T, header, pose
from foreign_messages import decoder
from rosbags.typesys import get_types_from_msg

PATH, TRAJECTORY = "nav_msgs/msg/Path", "autoware_planning_msgs/msg/Trajectory"
ROBOT = {"robot": {"topic": "/odom", "shape": {"box": [0.4, 0.4, 0.4]}}}
POINT = """\
builtin_interfaces/Duration time_from_start
geometry_msgs/Pose pose
float32 longitudinal_velocity_mps
float32 lateral_velocity_mps
float32 acceleration_mps2
float32 heading_rate_rps
float32 front_wheel_angle_rad
float32 rear_wheel_angle_rad
"""
DEFINITION = (
    f"std_msgs/Header header\nautoware_planning_msgs/TrajectoryPoint[] points\n{'=' * 80}\n"
    f"MSG: autoware_planning_msgs/TrajectoryPoint\n{POINT}"
)


def path(points: Any, stamps: Any = None, frame: str = "map", stamp: int = START) -> tuple[str, Any]:
    stamps = [0] * len(points) if stamps is None else stamps
    kind = T["geometry_msgs/msg/PoseStamped"]
    return PATH, T[PATH](
        header(frame, stamp), [kind(header(frame, t), pose(p)) for p, t in zip(points, stamps, strict=True)]
    )


def trajectory(points: Any, speeds: Any, times: Any = None) -> tuple[str, Any]:
    if TRAJECTORY not in T:
        STORE.register(get_types_from_msg(DEFINITION, TRAJECTORY))
        decoder().define(TRAJECTORY, DEFINITION)
    point, duration = T["autoware_planning_msgs/msg/TrajectoryPoint"], T["builtin_interfaces/msg/Duration"]
    rows = [
        point(duration(int(t), round(t % 1 * 1e9)), pose(p), v, 0.0, 0.0, 0.0, 0.0, 0.0)
        for p, v, t in zip(points, speeds, times or [0.0] * len(points), strict=True)
    ]
    return TRAJECTORY, T[TRAJECTORY](header("map", START), rows)
