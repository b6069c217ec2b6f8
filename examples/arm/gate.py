""".venv/bin/python examples/arm/gate.py

An arm follows joint trajectories through a gate. On the second way a post appears: the gate stops the arm before it,
and says which link, when and where. The post goes away again, and the arm goes on. Then a plan into the post is
refused.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped
from joint_controller import JointController
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

FOLDER = Path(__file__).parent
NAMES = [*(f"joint_{k}" for k in range(1, 8)), "finger_joint"]
LEFT = [-0.8, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.03]
RIGHT = [0.8, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.03]
SECONDS = 3.0  # of a way
AWAY, IN_THE_WAY = (4.0, 0.0), (0.6, 0.05)  # m: where the post is


class Cell(Node):
    """The arm with its controller, and the post. said: the newest state of the gate."""

    def __init__(self) -> None:
        super().__init__("cell")
        self.controller = JointController(NAMES, LEFT)
        self.post, self.said, self.went = AWAY, "", 0
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._joints_out = self.create_publisher(JointState, "/joint_states", 10)
        self._post_out = self.create_publisher(PoseStamped, "/post", 10)
        self._plan_out = self.create_publisher(JointTrajectory, "/joint_trajectory_in", 10)
        self.create_subscription(JointTrajectory, "/joint_trajectory_out", self._on_plan, 10)
        self.create_subscription(String, "/gate/state", self._on_state, latched)
        self.create_timer(0.01, self._publish)

    def _on_plan(self, message: Any) -> None:
        self.controller.take(message, time.monotonic())
        self.went += 1

    def _on_state(self, message: Any) -> None:
        self.said = message.data
        print(f"gate: {message.data}", flush=True)

    def _publish(self) -> None:
        now = self.get_clock().now().to_msg()
        position, velocity = self.controller.at(time.monotonic())
        joints = JointState(name=NAMES, position=position.tolist(), velocity=velocity.tolist())
        post = PoseStamped()
        joints.header.stamp = post.header.stamp = now
        post.header.frame_id, post.pose.orientation.w = "world", 1.0
        post.pose.position.x, post.pose.position.y = self.post
        post.pose.position.z = 0.8
        self._joints_out.publish(joints)
        self._post_out.publish(post)

    def plan(self, goal: list[float]) -> None:
        """Send a trajectory to a goal."""
        point = JointTrajectoryPoint(positions=goal, velocities=[0.0] * len(goal))
        point.time_from_start.sec = int(SECONDS)
        self._plan_out.publish(JointTrajectory(joint_names=NAMES, points=[point]))

    def wait(self, condition: Callable[[], bool], seconds: float = 600.0) -> None:
        """Let time pass until a condition holds."""
        end = time.monotonic() + seconds
        while rclpy.ok() and not condition():
            if time.monotonic() > end:
                raise SystemExit(f"the gate does not go on; it said: {self.said}")
            rclpy.spin_once(self, timeout_sec=0.02)

    def is_at(self, goal: list[float]) -> bool:
        """Whether the arm is at a goal."""
        return bool(abs(self.controller.at(time.monotonic())[0] - goal).max() < 1e-3)


def play(cell: Cell) -> None:
    """Go right, go left while the post appears, and try to go right through the post."""
    cell.wait(lambda: "no plan" in cell.said)
    cell.plan(RIGHT)
    cell.wait(lambda: cell.is_at(RIGHT))
    cell.wait(lambda: "no plan" in cell.said)
    print("the arm goes back, and a post appears on its way", flush=True)
    cell.plan(LEFT)
    cell.wait(lambda: cell.controller.at(time.monotonic())[0][0] < 0.6)
    cell.post = IN_THE_WAY
    cell.wait(lambda: cell.said.startswith("stops: arm/"))
    _rest(cell, 1.0)
    print("the post goes away", flush=True)
    cell.post = AWAY
    cell.wait(lambda: cell.is_at(LEFT))
    cell.wait(lambda: "no plan" in cell.said)
    cell.post = IN_THE_WAY
    _rest(cell, 0.5)
    print("the planner does not know of the post", flush=True)
    cell.plan(RIGHT)
    cell.wait(lambda: "refused a plan" in cell.said)


def _rest(cell: Cell, seconds: float) -> None:
    end = time.monotonic() + seconds
    cell.wait(lambda: time.monotonic() > end)


def main() -> None:
    """Run the monitor, the gate and the cell."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    program = "import sys; from collision_monitor.ros.executables import gate; sys.exit(gate())"
    given = ["robot:=arm/*", "base:=arm/base", f"urdf:={FOLDER / 'arm.urdf'}"]
    sources = FOLDER / "gate_sources.yaml"
    processes = [
        subprocess.Popen([sys.executable, "-m", "collision_monitor", "run", "--sources", str(sources)]),
        subprocess.Popen(
            [sys.executable, "-c", program, "--ros-args", *(each for one in given for each in ("-p", one))]
        ),
    ]
    rclpy.init()
    cell = Cell()
    try:
        play(cell)
    finally:
        cell.destroy_node()
        rclpy.try_shutdown()
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()


if __name__ == "__main__":
    main()
