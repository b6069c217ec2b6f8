""".venv/bin/python examples/robot_from_odometry.py

A robot drives towards a wall and publishes /odom, as any robot does. The monitor needs a sources file and no node in
between. The predictions count down to the impact.
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node

from collision_monitor_msgs.msg import PredictedCollisionArray

SOURCES = Path(__file__).with_suffix(".yaml")
SPEED = 0.8  # m/s
LISTENERS = 60.0  # s to wait for the monitor, which compiles its kernels on its first start


def listen(node: Node, seconds: float) -> None:
    """Run the callbacks of the node for this time."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0.0:
        rclpy.spin_once(node, timeout_sec=left)


def main() -> None:
    """Start the monitor, drive for 3 s, and print what it predicts."""
    monitor = subprocess.Popen([sys.executable, "-m", "collision_monitor", "run", "--sources", SOURCES])
    rclpy.init()
    node = rclpy.create_node("robot")
    odometry = node.create_publisher(Odometry, "/odom", 10)

    def show(message: PredictedCollisionArray) -> None:
        names = dict(zip(message.ids, message.names, strict=True))
        for each in message.predictions:
            print(f"{names[each.id_a]} meets {names[each.id_b]} in {each.lower:.2f} to {each.upper:.2f} s", flush=True)

    node.create_subscription(PredictedCollisionArray, "/object_monitor/predictions", show, 10)
    try:
        waited = 0.0
        while not odometry.get_subscription_count() and waited < LISTENERS:
            listen(node, 0.1)
            waited += 0.1
        for tick in range(60):
            message = Odometry()
            message.header.stamp = node.get_clock().now().to_msg()
            message.header.frame_id, message.child_frame_id = "odom", "base_link"
            message.pose.pose.position.x = SPEED * tick * 0.05
            message.twist.twist.linear.x = SPEED
            odometry.publish(message)
            listen(node, 0.05)
    finally:
        monitor.terminate()
        monitor.wait()
        node.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main()
