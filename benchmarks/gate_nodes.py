"""The processes of benchmarks/gate_executions.py (a monitor and two gates), and the topics to them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Final

import numpy as np

ROOT: Final = Path(__file__).parents[1]
URDF: Final = ROOT / "examples/arm/arm.urdf"
ARM_JOINTS: Final = [*(f"joint_{k}" for k in range(1, 8)), "finger_joint"]
PLACE: Final = np.array([0.0, 0.2, 0.0, -2.0, 0.0, 2.2, 0.785, 0.03])

MAX_AGE: Final = "max_age:=0.5"
"""Above the default: answers come late on a machine that other programs use. The reaction time rises with it."""

SOURCES: Final = f"""\
frame: map
rate: 30
objects:
  cart: {{topic: /odom, shape: {{cylinder: [0.3, 0.4]}}, allowed: [load]}}
  load: {{topic: /load, shape: {{box: [0.3, 0.9, 0.3]}}, allowed: [cart]}}
  crate: {{topic: /crate, shape: {{cylinder: [0.1, 2.0]}}}}
robots:
  arm: {{urdf: {URDF}, joint_states: /joint_states, base: {{pose: [0, 0, 0]}}}}
"""

sys.path.insert(0, str(ROOT / "examples/arm"))
from joint_controller import JointController  # noqa: E402


class GateNodes:
    """A monitor, a gate of an arm and one of a base, and what planners, controllers and sensors say to them.

    robots: of the caller, by name. used: name of the one that executes a plan. said: the newest state of its gate.
    told: monotonic s of its first message that slows the robot down, since it was set to None.
    """

    def __init__(self, folder: Path) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self._folder, self.robots = folder, {}
        (folder / "sources.yaml").write_text(SOURCES)
        program = "import sys; from collision_monitor.ros.executables import gate; sys.exit(gate())"
        arm = ["robot:=arm/*", "base:=arm/base", f"urdf:={URDF}", MAX_AGE]
        base = ["robot:=cart,load", "speed:=1.0", "tolerance:=0.2", "stamped:=true", MAX_AGE]
        self._processes = [
            self._start("monitor", "-m", "collision_monitor", "run", "--sources", "sources.yaml"),
            *(
                self._start(name, "-c", program, "--ros-args", "-r", f"__node:={name}", *self._given(given), *topics)
                for name, given, topics in (
                    ("arm_gate", arm, ["-r", "cmd_vel_out:=/arm_cmd_vel_out"]),
                    ("base_gate", base, []),
                )
            ),
        ]
        self.controller = JointController(ARM_JOINTS, PLACE, delay=0.03)
        self._states = {"arm": "", "base": ""}
        self.used, self.is_passed, self.told = "base", False, None
        self._commands: list[tuple[float, float]] = []
        rclpy.init()
        self.node = rclpy.create_node("executions")
        self._open()
        executor = SingleThreadedExecutor()
        executor.add_node(self.node)
        threading.Thread(target=executor.spin, daemon=True).start()

    # -- processes

    @staticmethod
    def _given(parameters: list[str]) -> list[str]:
        return [each for parameter in parameters for each in ("-p", parameter)]

    def _start(self, name: str, *arguments: str) -> subprocess.Popen[bytes]:
        log = (self._folder / f"{name}_{time.monotonic_ns()}.log").open("w")
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
        return subprocess.Popen([sys.executable, *arguments], env=environment, cwd=self._folder, stdout=log, stderr=log)

    def close(self) -> None:
        """End the processes."""
        for process in self._processes:
            process.send_signal(signal.SIGINT)
        for process in self._processes:
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()

    # -- topics

    def _open(self) -> None:
        from geometry_msgs.msg import PoseStamped, TwistStamped
        from nav_msgs.msg import Odometry
        from nav_msgs.msg import Path as PathMessage
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from sensor_msgs.msg import JointState
        from std_msgs.msg import Float64, String
        from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

        self._kinds = (
            PoseStamped,
            TwistStamped,
            Odometry,
            PathMessage,
            JointState,
            JointTrajectory,
            JointTrajectoryPoint,
        )
        node, latched = self.node, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._joints_out = node.create_publisher(JointState, "/joint_states", 10)
        self._odometry_out = {
            name: node.create_publisher(Odometry, f"/{name}", 10) for name in ("odom", "load", "crate")
        }
        self._trajectory_out = node.create_publisher(JointTrajectory, "/joint_trajectory_in", 10)
        self._path_out = node.create_publisher(PathMessage, "/path_in", 10)
        self._command_out = node.create_publisher(TwistStamped, "/cmd_vel_in", 1)
        node.create_subscription(JointTrajectory, "/joint_trajectory_out", self._on_trajectory, 10)
        node.create_subscription(PathMessage, "/path_out", self._on_path, 10)
        node.create_subscription(TwistStamped, "/cmd_vel_out", self._on_command, 100)
        for name in self._states:
            self._listen(name, String, Float64, latched)

    def _listen(self, name: str, text: Any, number: Any, latched: Any) -> None:
        def on_state(message: Any) -> None:
            self._states[name] = message.data

        def on_scale(message: Any) -> None:
            if name == self.used and message.data < 1.0 and self.told is None:
                self.told = time.monotonic()

        self.node.create_subscription(text, f"/{name}_gate/state", on_state, latched)
        self.node.create_subscription(number, f"/{name}_gate/speed_scale", on_scale, latched)

    def _on_trajectory(self, message: Any) -> None:
        self.controller.take(message, time.monotonic())
        self.is_passed |= bool(message.points) and self.used == "arm"

    def _on_path(self, message: Any) -> None:
        self.is_passed |= bool(message.poses) and self.used == "base"

    def _on_command(self, message: Any) -> None:
        self._commands.append((time.monotonic(), message.twist.linear.x))
        del self._commands[:-200]

    def use(self, name: str) -> None:
        """Use the gate of the arm or of the base from now on."""
        self.used = name

    def forget(self) -> None:
        """Forget what was passed so far."""
        self.is_passed, self.told = False, None

    @property
    def said(self) -> str:
        """The newest state of the gate in use."""
        return self._states[self.used]

    @property
    def is_ready(self) -> bool:
        """Whether the gate in use knows all that it needs."""
        return "no plan" in self.said or "ended the plan" in self.said or "refused" in self.said or "left" in self.said

    def command(self, now: float) -> float:
        """The last speed (m/s) that the gate passed until now (monotonic s)."""
        return next((speed for at, speed in reversed(self._commands) if at <= now), 0.0)

    # -- what is said

    def _stamped(self, message: Any, frame: str = "map") -> Any:
        message.header.stamp, message.header.frame_id = self.node.get_clock().now().to_msg(), frame
        return message

    def joints(self, q: Any, qd: Any) -> None:
        """Publish the joints."""
        kind = self._kinds[4]
        self._joints_out.publish(self._stamped(kind(name=ARM_JOINTS, position=q.tolist(), velocity=qd.tolist())))

    def odometry(self, x: float, v: float) -> None:
        """Publish where the base and its load are."""
        self._pose("odom", (x, 20.0, 0.25), (v, 0.0))
        self._pose("load", (x, 20.0, 0.65), (v, 0.0))

    def crate(self, place: Any, walk: Any) -> None:
        """Publish where the obstacle is."""
        self._pose("crate", place, walk)

    def _pose(self, name: str, place: Any, velocity: Any) -> None:
        message = self._stamped(self._kinds[2](child_frame_id=name))
        at = message.pose.pose
        at.position.x, at.position.y, at.position.z = (float(each) for each in place)
        at.orientation.w = 1.0
        message.twist.twist.linear.x, message.twist.twist.linear.y = float(velocity[0]), float(velocity[1])
        self._odometry_out[name].publish(message)

    def drive(self, speed: float) -> None:
        """Publish a command of the follower of the path."""
        message = self._stamped(self._kinds[1](), "")
        message.twist.linear.x = speed
        self._command_out.publish(message)

    def send_trajectory(self, points: list[Any]) -> None:
        """Publish a plan of the arm; none ends the one before."""
        message = self._kinds[5](joint_names=ARM_JOINTS)
        for t, q, qd in points:
            point = self._kinds[6](positions=q.tolist(), velocities=qd.tolist())
            point.time_from_start.sec, point.time_from_start.nanosec = divmod(round(t * 1e9), 1_000_000_000)
            message.points.append(point)
        self._trajectory_out.publish(message)

    def send_path(self, begin: float, end: float | None) -> None:
        """Publish a plan of the base; None ends the one before."""
        message = self._stamped(self._kinds[3]())
        for x in np.arange(begin, end, 0.05) if end is not None else ():
            pose = self._kinds[0]()
            pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = float(x), 20.0, 0.25
            pose.pose.orientation.w = 1.0
            message.poses.append(pose)
        self._path_out.publish(message)
