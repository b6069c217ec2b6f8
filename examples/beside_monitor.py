"""What the examples share: the monitor as a process beside them, and the callbacks of their own node."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rclpy
from rclpy.node import Node
from rclpy.publisher import Publisher

from collision_monitor_msgs.msg import PredictedCollisionArray

PREDICTIONS = "/object_monitor/predictions"
LONGEST_START = 60.0  # s; the monitor compiles its kernels on its first start


@contextmanager
def monitored(sources: Path, name: str) -> Iterator[Node]:
    """Start the monitor with a sources file, and yield a node of this name. Both end with the block."""
    monitor = subprocess.Popen([sys.executable, "-m", "collision_monitor", "run", "--sources", sources])
    rclpy.init()
    node = rclpy.create_node(name)
    try:
        yield node
    finally:
        monitor.terminate()
        monitor.wait()
        node.destroy_node()
        rclpy.shutdown()


def listen(node: Node, seconds: float) -> None:
    """Run the callbacks of the node for this time."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0.0:
        rclpy.spin_once(node, timeout_sec=left)


def wait_for_subscribers(node: Node, *publishers: Publisher) -> None:
    """Listen until each publisher has a subscriber, or for LONGEST_START."""
    end = time.monotonic() + LONGEST_START
    while not all(each.get_subscription_count() for each in publishers) and time.monotonic() < end:
        listen(node, 0.1)


def print_predictions(node: Node) -> None:
    """Print each prediction of the monitor from now on."""

    def show(message: PredictedCollisionArray) -> None:
        names = dict(zip(message.ids, message.names, strict=True))
        for each in message.predictions:
            print(f"{names[each.id_a]} meets {names[each.id_b]} in {each.lower:.2f} to {each.upper:.2f} s", flush=True)

    node.create_subscription(PredictedCollisionArray, PREDICTIONS, show, 10)
