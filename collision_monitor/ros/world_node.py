"""Plays a scene as a robot team would publish it: shapes once, latched, then states at a steady rate.

ros2 run collision_monitor world --ros-args -p scene:=fleet -p objects:=200
"""

from __future__ import annotations

import math
import time

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from collision_monitor import codec
from collision_monitor.checks.numbers import checked_number
from collision_monitor.errors import CollisionMonitorError
from collision_monitor.pipeline.topics import NODE, Topic
from collision_monitor.ros.endpoints import publisher, subscription
from collision_monitor.ros.names import check_node_name
from collision_monitor.ros.parameters import ParameterReader, begin_node
from collision_monitor.ros.process import WAKE_UP, StopRequest
from collision_monitor.world import make_scene, scene_names
from collision_monitor.world.rigid.response_choice import METHODS

PARAMETERS = (
    "scene", "objects", "rate", "duration", "seed", "path", "noise", "restitution", "gravity", "response", "monitor",
    "frame_id",
)  # fmt: skip

LISTENER_PATIENCE = 4.0
"""s to wait for a monitor: on a busy machine DDS can lose its first announcement, and repeats it 3 s later."""

SHAPES_PATIENCE = 10.0
"""s to wait until the monitor knows the shapes; ten thousand take it one second."""


class WorldNode(Node):
    """Publishes one scene to one monitor. Raises InputError for an impossible scene or parameter."""

    def __init__(self) -> None:
        begin_node(self, "world")
        try:
            self._read_parameters()
        except CollisionMonitorError:
            self.destroy_node()
            raise
        shapes, states = Topic.SHAPES.of(self._monitor), Topic.STATES.of(self._monitor)
        check_node_name(self._monitor)
        self._shapes_out = publisher(self, Topic.SHAPES, shapes)
        self._states_out = publisher(self, Topic.STATES, states)

    def _read_parameters(self) -> None:
        reader = ParameterReader(self, PARAMETERS)
        name = reader.read("scene", "fleet", f"Scene to play: one of {', '.join(scene_names())}.")
        objects = reader.read("objects", 0, "Number of moving objects; 0: the scene's own number.")
        rate = reader.read("rate", 0.0, "Messages per second [Hz]; 0: the scene's own rate.")
        seed = reader.read("seed", 1, "Seed of the scene's random numbers.")
        path = reader.read("path", "", "Path of recorded tracks, for the scene that plays them.")
        noise = reader.read(
            "noise", 0.0, "Standard deviation of noise on the states [m, rad, m/s, rad/s]; the states declare it."
        )
        restitution = reader.read(
            "restitution", -1.0, "Bounce of bodies that respond, 0 (none) to 1 (elastic); -1: the scene's own."
        )
        gravity = reader.read("gravity", -1.0, "Gravity along -z in these scenes [m/s^2]; -1: the scene's own.")
        response = reader.read("response", "", f"Method of these scenes: one of {', '.join(METHODS)}.")
        self._scene = make_scene(
            name,
            objects=objects or None,
            seed=seed,
            rate=rate or None,
            path=path or None,
            noise=noise,
            restitution=None if restitution == -1.0 else restitution,
            gravity=None if gravity == -1.0 else gravity,
            response=response or None,
        )
        self._duration = reader.read(
            "duration", 0.0, "Time after which it stops [s]; 0: at the scene's own end, or never."
        )
        checked_number(self._duration, "duration", "seconds", least=0.0)
        self._monitor = reader.read("monitor", NODE, "Name of the monitor to publish to.").strip("/")
        self._frame_id = reader.read("frame_id", "world", "Frame of all poses.")

    def play(self, stop: StopRequest) -> None:
        """Publish until the duration or the scene ends, or a stop is requested.

        Deadlines count from the start, so the rate does not drift. Stamps are those deadlines, so states are exactly
        one period apart. If the machine is too slow, the node skips whole periods and counts them.
        """
        scene, period = self._scene, 1.0 / self._scene.rate
        self.get_logger().info(
            f"{scene.name}: {len(scene.descriptions)} objects at {scene.rate:g} Hz to {self._states_out.topic_name}"
        )
        self._wait_for_listener(stop)
        now = self.get_clock().now().nanoseconds
        self._shapes_out.publish(codec.encode_descriptions(now, self._frame_id, scene.descriptions, snapshot=True))
        self._wait_for_shapes_taken(stop)
        end = self._duration or math.inf
        states = scene.states()
        tick = messages = skipped = 0
        latest = 0.0
        first_stamp, began = self.get_clock().now().nanoseconds, time.monotonic()
        while not scene.finished and tick * period < end and _sleep_until(began + tick * period, stop):
            messages += 1
            stamp = first_stamp + round(tick * period * 1e9)
            self._states_out.publish(codec.encode_states(stamp, self._frame_id, messages, states))
            late = time.monotonic() - began - tick * period
            latest = max(latest, late)
            missed = int(late / period)
            skipped += missed
            tick += 1 + missed
            states = scene.step(period * (1 + missed))
        self.get_logger().info(
            f"published {messages} messages in {time.monotonic() - began:.1f} s, {skipped} periods skipped, "
            f"at most {latest * 1e3:.1f} ms after their stamp"
        )

    def _wait_for_listener(self, stop: StopRequest) -> None:
        """Wait for a running monitor, so that it gets all of the scene; give up after LISTENER_PATIENCE."""
        patience = time.monotonic() + LISTENER_PATIENCE
        while not self._states_out.get_subscription_count() and time.monotonic() < patience and not stop.received:
            time.sleep(0.01)

    def _wait_for_shapes_taken(self, stop: StopRequest) -> None:
        """Wait until the monitor's status counts all objects: before that, states would queue up and be lost.

        Return at once without a monitor, and after SHAPES_PATIENCE if it refuses some of the objects.
        """
        topic = Topic.STATUS.of(self._monitor)
        known: list[int] = []
        statuses = subscription(self, Topic.STATUS, lambda data: known.append(codec.decode_status(data).objects), topic)
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        patience = time.monotonic() + SHAPES_PATIENCE
        while self.count_publishers(topic) and len(self._scene.descriptions) not in known:
            if time.monotonic() > patience or stop.received:
                break
            executor.spin_once(timeout_sec=WAKE_UP)
        executor.remove_node(self)
        executor.shutdown()
        self.destroy_subscription(statuses)


def _sleep_until(deadline: float, stop: StopRequest) -> bool:
    """Sleep until the deadline; return False if a stop was requested. Checks for it every WAKE_UP seconds."""
    while not stop.received:
        left = deadline - time.monotonic()
        if left <= 0.0:
            return True
        time.sleep(min(left, WAKE_UP))
    return False
