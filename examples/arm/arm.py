""".venv/bin/python examples/arm/arm.py

An arm swings into a post and back. The monitor knows its URDF and /joint_states, as sources.yaml says, and predicts
which link hits the post, and when. The driver of a real arm publishes the same topic.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
from pathlib import Path

import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState

from collision_monitor_msgs.msg import ContactArray, PredictedCollisionArray

SOURCES = Path(__file__).with_name("sources.yaml")
NAMES = [*(f"joint_{k}" for k in range(1, 8)), "finger_joint"]
AT_REST = [0.0, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.03]
SWING, FREQUENCY = 1.3, 0.12  # rad, Hz of joint_1
RATE = 500.0


class Arm(Node):
    """Publishes the joints of a swinging arm, and prints what the monitor answers about it."""

    def __init__(self) -> None:
        super().__init__("arm")
        self._out = self.create_publisher(JointState, "/joint_states", 10)
        self.seconds = 0.0  # since the monitor listens
        self._began = 0.0
        self._touching: set[tuple[str, str]] = set()
        self._next_line = 0.0
        self.create_subscription(PredictedCollisionArray, "/object_monitor/predictions", self._on_predictions, 10)
        self.create_subscription(ContactArray, "/object_monitor/contacts", self._on_contacts, 10)
        self.create_timer(1.0 / RATE, self._publish)

    def _publish(self) -> None:
        if not self._out.get_subscription_count():  # the monitor is not there yet
            return
        now = self.get_clock().now()
        self._began = self._began or now.nanoseconds * 1e-9
        self.seconds = now.nanoseconds * 1e-9 - self._began
        phase = 2.0 * math.pi * FREQUENCY * self.seconds
        speed = 2.0 * math.pi * FREQUENCY * SWING * math.cos(phase)
        message = JointState(name=NAMES, position=[SWING * math.sin(phase), *AT_REST[1:]], velocity=[speed, *[0.0] * 7])
        message.header.stamp = now.to_msg()
        self._out.publish(message)

    def _on_predictions(self, message: PredictedCollisionArray) -> None:
        names = dict(zip(message.ids, message.names, strict=True))
        certain = [each for each in message.predictions if each.lower > 0.0 and math.isfinite(each.upper)]
        if certain and self.seconds >= self._next_line:
            self._next_line = self.seconds + 0.2
            soonest = min(certain, key=lambda each: each.lower)
            pair = f"{names[soonest.id_a]} meets {names[soonest.id_b]}"
            print(f"in {soonest.lower:.3f} to {soonest.upper:.3f} s {pair}", flush=True)

    def _on_contacts(self, message: ContactArray) -> None:
        names = dict(zip(message.ids, message.names, strict=True))
        touching = {(names[each.id_a], names[each.id_b]) for each in message.contacts}
        for a, b in sorted(touching - self._touching):
            print(f"now {a} touches {b}", flush=True)
        self._touching = touching


def main() -> None:
    """Run the monitor and the arm."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=9.0, help="stop so long after the start of the swing")
    arguments = parser.parse_args()
    monitor = subprocess.Popen([sys.executable, "-m", "collision_monitor", "run", "--sources", str(SOURCES)])
    rclpy.init()
    node = Arm()
    try:
        while rclpy.ok() and monitor.poll() is None and node.seconds < arguments.seconds:
            rclpy.spin_once(node, timeout_sec=0.1)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
        monitor.terminate()
        monitor.wait()


if __name__ == "__main__":
    main()
