""".venv/bin/python examples/robot_from_odometry.py

A robot drives towards a wall and publishes /odom, as any robot does. The monitor needs a sources file and no node in
between. The predictions count down to the impact.
"""

from __future__ import annotations

from pathlib import Path

from beside_monitor import listen, monitored, print_predictions, wait_for_subscribers
from nav_msgs.msg import Odometry

SOURCES = Path(__file__).with_suffix(".yaml")
SPEED = 0.8  # m/s


def main() -> None:
    """Start the monitor, drive for 3 s, and print what it predicts."""
    with monitored(SOURCES, "robot") as node:
        odometry = node.create_publisher(Odometry, "/odom", 10)
        print_predictions(node)
        wait_for_subscribers(node, odometry)
        for tick in range(60):
            message = Odometry()
            message.header.stamp = node.get_clock().now().to_msg()
            message.header.frame_id, message.child_frame_id = "odom", "base_link"
            message.pose.pose.position.x = SPEED * tick * 0.05
            message.twist.twist.linear.x = SPEED
            odometry.publish(message)
            listen(node, 0.05)


if __name__ == "__main__":
    main()
