""".venv/bin/python examples/brake_before_impact.py

A subscriber that reacts to predictions: it scales the speed of the robot down with the time that is left, which
stops it before the wall. In place of the simulated robot, publish the factor to your own velocity controller.
"""

from __future__ import annotations

import sys
from pathlib import Path

from beside_monitor import PREDICTIONS, listen, monitored, wait_for_subscribers
from nav_msgs.msg import Odometry
from rclpy.node import Node

from collision_monitor_msgs.msg import PredictedCollisionArray

SOURCES = Path(__file__).with_name("robot_from_odometry.yaml")
PERIOD = 0.05  # s
WALL = 3.5 - 0.1 - 0.3 - 0.05  # m: where the padded front of the robot touches


class Brake:
    """Scales the speed: full with 2 s to the safe end of the earliest time of impact, none with 0.5 s."""

    def __init__(self, node: Node) -> None:
        self.factor = 1.0
        node.create_subscription(PredictedCollisionArray, PREDICTIONS, self._on_predictions, 10)

    def _on_predictions(self, message: PredictedCollisionArray) -> None:
        soonest = min((each.lower for each in message.predictions), default=float("inf"))  # `lower` is safe
        self.factor = min(1.0, max(0.0, (soonest - 0.5) / 1.5))


class Robot:
    """A robot that follows the commanded speed with at most 2 m/s^2."""

    def __init__(self, node: Node) -> None:
        self.position = self.speed = 0.0
        self._node = node
        self.out = node.create_publisher(Odometry, "/odom", 10)

    def drive(self, wanted: float) -> None:
        """Move for one period, and publish the odometry."""
        self.speed += min(2.0 * PERIOD, max(-2.0 * PERIOD, wanted - self.speed))
        self.position += self.speed * PERIOD
        message = Odometry()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.header.frame_id, message.child_frame_id = "odom", "base_link"
        message.pose.pose.position.x, message.twist.twist.linear.x = self.position, self.speed
        self.out.publish(message)


def main() -> int:
    """Start the monitor, drive at 0.8 m/s for up to 12 s, and return 0 if the robot stopped before the wall."""
    with monitored(SOURCES, "robot") as node:
        robot, brake = Robot(node), Brake(node)
        wait_for_subscribers(node, robot.out)
        for tick in range(240):
            robot.drive(0.8 * brake.factor)
            listen(node, PERIOD)
            if tick > 60 and robot.speed < 0.02:
                break
    print(f"stopped {WALL - robot.position:.2f} m before the wall at {robot.speed:.2f} m/s")
    return 0 if robot.position < WALL else 1


if __name__ == "__main__":
    sys.exit(main())
