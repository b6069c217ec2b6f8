"""The processes of benchmarks/guard_encounters.py (two monitors and a guard), and the topics to them."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).parents[1]
RADIUS_ROBOT, RADIUS_CRATE = 0.3, 0.25  # m
PATIENCE: Final = 900.0
"""s for the nodes to be ready: a first start compiles kernels, and other programs may need the machine."""

SOURCES: Final = f"""\
frame: map
rate: 20
objects:
  robot_1: {{topic: /odom, shape: {{cylinder: [{RADIUS_ROBOT}, 1.0]}}}}
  crate: {{topic: /crate, shape: {{cylinder: [{RADIUS_CRATE}, 1.0]}}}}
robots:
  rack: {{urdf_topic: /rack, base: {{pose: [0, 60, 0]}}}}
"""

RACK: Final = """\
<robot name="rack">
  <link name="foot"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
  <link name="board"><collision><geometry>{board}</geometry></collision></link>
  <joint name="joint" type="fixed"><parent link="foot"/><child link="board"/><origin xyz="0 0 2"/></joint>
</robot>
"""
WHOLE_RACK: Final = RACK.format(board='<box size="1 1 0.1"/>')
RULES: Final = (ROOT / "config/guard_rules.yaml").read_text()


class Nodes:
    """Two monitors, of which the second one is not configured, a guard, and what a planner and a base say to them.

    commands: (monotonic s, speed in m/s) of what the guard published, the oldest first. said: its newest state.
    others: monotonic s at which a monitor with another number than that of the last rest first answered, or None.
    """

    def __init__(self, folder: Path) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self._folder = folder
        (folder / "sources.yaml").write_text(SOURCES)
        self.monitor = self._start_monitor()
        again = ["-r", "__node:=second_monitor", "-r", "~/raised_alerts:=/object_monitor/raised_alerts"]
        self._second = self._start_monitor(*again, "-p", "autostart:=false")
        program = "import sys; from collision_monitor.ros.executables import guard; sys.exit(guard())"
        guard = ["--ros-args", "-p", "robot:=robot_1", "-p", "stamped:=true"]
        self._guard = self._start("guard", "-c", program, *guard)
        self.commands: list[tuple[float, float]] = []
        self.said, self.others = "", None
        self._known: int | None = None
        self._answered: int | None = None  # stamp of the last answer, ns
        rclpy.init()
        self.node = rclpy.create_node("encounters")
        self._open()
        executor = SingleThreadedExecutor()
        executor.add_node(self.node)
        threading.Thread(target=executor.spin, daemon=True).start()

    # -- processes

    def _start(self, name: str, *arguments: str) -> subprocess.Popen[bytes]:
        log = (self._folder / f"{name}_{time.monotonic_ns()}.log").open("w")
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        return subprocess.Popen([sys.executable, *arguments], env=environment, cwd=self._folder, stdout=log, stderr=log)

    def _start_monitor(self, *ros: str) -> subprocess.Popen[bytes]:
        files = ["--rules", str(ROOT / "config/guard_rules.yaml"), "--sources", "sources.yaml"]
        return self._start("monitor", "-m", "collision_monitor", "run", *files, "--ros-args", *ros)

    def restart_monitor(self) -> None:
        """Kill the monitor and start another one."""
        self.monitor.kill()
        self.monitor.wait()
        self.monitor = self._start_monitor()

    def freeze(self, is_frozen: bool) -> None:
        """Stop the monitor's process, or let it go on."""
        self.monitor.send_signal(signal.SIGSTOP if is_frozen else signal.SIGCONT)

    def change_second(self, *transitions: int) -> None:
        """Bring the second monitor through transitions of its life cycle (lifecycle_msgs/Transition)."""
        from lifecycle_msgs.msg import Transition
        from lifecycle_msgs.srv import ChangeState

        for each in transitions:
            request = ChangeState.Request(transition=Transition(id=each))
            pending = self._change.call_async(request)
            deadline = time.monotonic() + PATIENCE
            while not pending.done() and time.monotonic() < deadline:
                time.sleep(0.02)
            if not pending.done() or not pending.result().success:
                raise RuntimeError(f"the second monitor refused transition {each}")

    def close(self) -> None:
        """End the processes."""
        processes = (self.monitor, self._second, self._guard)
        for process in processes:
            process.send_signal(signal.SIGCONT)
            process.send_signal(signal.SIGINT)
        for process in processes:
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()

    # -- topics

    def _open(self) -> None:
        from geometry_msgs.msg import TwistStamped
        from lifecycle_msgs.srv import ChangeState
        from nav_msgs.msg import Odometry
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from std_msgs.msg import String

        from collision_monitor.pipeline.topics import Topic
        from collision_monitor.ros.endpoints import subscription

        self.Twist, self.Odometry, self._String = TwistStamped, Odometry, String
        node, latched = self.node, QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._command_out = node.create_publisher(TwistStamped, "cmd_vel_in", 1)
        self._odometry_out = {name: node.create_publisher(Odometry, f"/{name}", 10) for name in ("odom", "crate")}
        self._rack_out = node.create_publisher(String, "/rack", latched)
        self._rules_out = node.create_publisher(String, "/object_monitor/rules", latched)
        self._change = node.create_client(ChangeState, "/second_monitor/change_state")
        node.create_subscription(TwistStamped, "cmd_vel_out", self._on_command, 100)
        node.create_subscription(String, "/guard/state", self._on_state, latched)
        subscription(node, Topic.RAISED_ALERTS, self._on_alerts, Topic.RAISED_ALERTS.of("object_monitor"))

    def _on_command(self, message: Any) -> None:
        self.commands.append((time.monotonic(), message.twist.linear.x))

    def _on_state(self, message: Any) -> None:
        self.said = message.data

    def _on_alerts(self, data: bytes) -> None:
        from collision_monitor.codec import decode_alerts

        array = decode_alerts(data)
        self._answered, number = array.stamp_ns, array.monitor
        if self._known is None:
            self._known = number
        if number != self._known and self.others is None:
            self.others = time.monotonic()

    def forget(self) -> None:
        """Begin anew to keep commands and to watch for other monitors."""
        self.commands.clear()
        self.others = self._known = None

    @property
    def age(self) -> float:
        """Age of the last answer by its stamp (s); infinite: none arrived."""
        return math.inf if self._answered is None else (self.now - self._answered) * 1e-9

    @property
    def now(self) -> int:
        """The time in ns."""
        return int(self.node.get_clock().now().nanoseconds)

    @property
    def passes(self) -> bool:
        """Whether the guard said last that it passes commands."""
        return self.said.startswith("passes")

    def command(self, speed: float, stamp_ns: int | None = None) -> Any:
        """Return a command to drive ahead (m/s)."""
        message = self.Twist()
        _stamp(message.header.stamp, self.now if stamp_ns is None else stamp_ns)
        message.twist.linear.x = speed
        return message

    def send(self, command: Any) -> None:
        """Publish a command of the planner."""
        self._command_out.publish(command)

    def odometry(self, name: str, stamp_ns: int, place: tuple[float, float], velocity: tuple[float, float]) -> None:
        """Publish where the robot (`odom`) or the crate is (m) and its velocity (m/s), along the map's axes."""
        self._odometry(name, stamp_ns, place, velocity, "map")

    def lost(self, stamp_ns: int, place: tuple[float, float]) -> None:
        """Publish the crate in a frame that tf does not have."""
        self._odometry("crate", stamp_ns, place, (0.0, 0.0), "nowhere")

    def _odometry(
        self, name: str, stamp_ns: int, place: tuple[float, float], velocity: tuple[float, float], frame: str
    ) -> None:
        message = self.Odometry(child_frame_id=name)
        message.header.frame_id = frame
        _stamp(message.header.stamp, stamp_ns)
        message.pose.pose.position.x, message.pose.pose.position.y = place
        message.pose.pose.orientation.w = 1.0
        message.twist.twist.linear.x, message.twist.twist.linear.y = velocity
        self._odometry_out[name].publish(message)

    def rack(self, text: str) -> None:
        """Publish the URDF of the rack."""
        self._rack_out.publish(self._String(data=text))

    def rules(self, text: str) -> None:
        """Replace the rules of the monitor."""
        self._rules_out.publish(self._String(data=text))


def _stamp(to: Any, stamp_ns: int) -> None:
    to.sec, to.nanosec = divmod(stamp_ns, 1_000_000_000)
