""".venv/bin/python examples/robot_on_path.py

A robot follows a path as a planner of Nav2 publishes it once a second on /plan: poses without stamps and orientations.
The path bends towards a crate. While the robot drives straight, its odometry says that it passes the crate; its path
says that it will meet it behind the bend. On its other side, a gate moves by a declared schedule.
"""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path

from beside_monitor import listen, monitored, print_predictions, wait_for_subscribers
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from nav_msgs.msg import Path as PathMessage

SOURCES = Path(__file__).with_suffix(".yaml")
SPEED = 0.8  # m/s
STRAIGHT, RADIUS = 1.0, 0.7  # m


def place(way: float) -> tuple[float, float, float]:
    """Position (m) and heading (rad) after so many m of the path: straight, a quarter of a circle, straight."""
    angle = min(max(way - STRAIGHT, 0.0) / RADIUS, pi / 2)
    beyond = max(way - STRAIGHT - RADIUS * pi / 2, 0.0)
    return min(way, STRAIGHT) + RADIUS * sin(angle), RADIUS * (1.0 - cos(angle)) + beyond, angle


def path(stamp: Time) -> PathMessage:
    """The path with a pose every 5 cm."""
    message = PathMessage()
    message.header.frame_id, message.header.stamp = "map", stamp
    for k in range(60):
        pose = PoseStamped()
        pose.pose.position.x, pose.pose.position.y, _ = place(0.05 * k)
        message.poses.append(pose)
    return message


def main() -> None:
    """Start the monitor, drive for 2 s, and print what it predicts."""
    with monitored(SOURCES, "robot") as node:
        odometry, plan = node.create_publisher(Odometry, "/odom", 10), node.create_publisher(PathMessage, "/plan", 10)
        print_predictions(node)
        wait_for_subscribers(node, odometry, plan)
        for tick in range(40):
            message = Odometry()
            message.header.stamp = node.get_clock().now().to_msg()
            message.header.frame_id, message.child_frame_id = "map", "base_link"
            pose, twist = message.pose.pose, message.twist.twist
            pose.position.x, pose.position.y, heading = place(SPEED * tick * 0.05)
            pose.orientation.z, pose.orientation.w = sin(heading / 2), cos(heading / 2)
            twist.linear.x, twist.angular.z = SPEED, SPEED / RADIUS if heading > 0.0 else 0.0
            odometry.publish(message)
            if tick % 20 == 5:
                plan.publish(path(message.header.stamp))
            listen(node, 0.05)


if __name__ == "__main__":
    main()
