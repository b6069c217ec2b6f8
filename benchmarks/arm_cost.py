"""Measures the CPU that a node needs for an arm of seven joints at 500 Hz, beside the monitor.

    python benchmarks/arm_cost.py [--seconds 20] [--rate 500] [--executor events] [--tracks 200]

The node runs twice in turns: with the sources file of examples/arm, and with the states that it made of it, on the
node's own topics. The difference of the two is the price of the joint states: DDS, decoding, kinematics. Then the same
messages are fed without ROS. CPU is that of the whole process, in percent of one core. --tracks adds tracked objects
at 20 Hz to the sources.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from rclpy.node import Node
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from sources import people, raw, seen

from collision_monitor.cli.child import Child
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.domain import free_domain
from collision_monitor.ros.endpoints import publisher
from collision_monitor.ros.process import ros_context, stay_on_this_machine
from collision_monitor.session import Session
from collision_monitor.sources import Decoder, Feed, Input, RawMessage, load_mapping

ARM: Final = Path(__file__).parents[1] / "examples/arm"
TRACKED: Final = "autoware_perception_msgs/msg/TrackedObjects"
TRACK_RATE: Final = 20.0
"""Hz of the tracked objects."""
NAMES: Final = [*(f"joint_{k}" for k in range(1, 8)), "finger_joint"]
KIND: Final = "sensor_msgs/msg/JointState"
STORE: Final = get_typestore(Stores.ROS2_JAZZY)
TICK: Final = os.sysconf("SC_CLK_TCK")
WARM: Final = 3.0
"""s of messages before the measurement."""


def cpu(pid: int) -> float:
    """Return the CPU seconds of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def joint_state(stamp: int, time_s: float) -> bytes:
    """Return a JointState of a waving arm."""
    types = STORE.types
    time_of = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    phase = np.arange(8.0) + time_s
    position, velocity = 0.5 * np.sin(phase), 0.5 * np.cos(phase)
    message = types[KIND](types["std_msgs/msg/Header"](time_of, ""), NAMES, position, velocity, np.zeros(0))
    return bytes(STORE.serialize_cdr(message, KIND))


def pace(rate: float, seconds: float) -> Any:
    """Yield the number of each message when it is due."""
    began = time.monotonic()
    for k in range(round(rate * seconds)):
        wait = began + k / rate - time.monotonic()
        if wait > 0.0:
            time.sleep(wait)
        yield k


def sources_file(folder: Path, tracks: int) -> Path:
    """Write the sources of examples/arm, with tracked objects if there are any."""
    content = yaml.safe_load((ARM / "sources.yaml").read_text())
    for robot in content["robots"].values():
        robot |= {key: str(ARM / robot[key]) for key in ("urdf", "srdf") if key in robot}
    if tracks:
        content["objects"]["people"] = {"topic": "/tracks"}
    path = folder / "sources.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def tracked(count: int) -> list[Any]:
    """Return a second of TrackedObjects of this many walking people."""
    places, velocities = people(np.random.default_rng(1), count)
    return [seen(places, velocities, k / TRACK_RATE, 0, "world")[1] for k in range(int(TRACK_RATE))]


def with_sources(
    node: Node, rate: float, seconds: float, sources: Path, tracks: int, record: Path, options: list[str]
) -> float:
    """Return the CPU (% of a core) of a node that reads joint states, and tracked objects if there are any."""
    outs = [node.create_publisher(JointState, "/joint_states", 10)]
    if tracks:
        from autoware_perception_msgs.msg import TrackedObjects

        outs.append(node.create_publisher(TrackedObjects, "/tracks", 10))
    messages, every = tracked(tracks), round(rate / TRACK_RATE)

    def publish(k: int) -> None:
        outs[0].publish(joint_state(time.time_ns(), k / rate))
        if tracks and k % every == 0:
            message = messages[k // every % len(messages)]
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
            outs[1].publish(raw("/tracks", (TRACKED, message)).data)

    with Child("run", "--sources", str(sources), "--record", str(record), *options) as child:
        wait_for(lambda: all(each.get_subscription_count() for each in outs), child)
        share = measured(child, rate, seconds, publish)
        child.finish()
    for each in outs:
        node.destroy_publisher(each)
    return share


def without_sources(node: Node, seconds: float, record: Path, options: list[str]) -> float:
    """Return the CPU of a node that gets the same objects and as many states on its own topics."""
    messages = list(Session(record).messages())
    states = [m.data for m in messages if m.type == Topic.STATES.message]
    shapes = [m.data for m in messages if m.type == Topic.SHAPES.message]
    shapes_out, states_out = (
        publisher(node, Topic.SHAPES, Topic.SHAPES.of()),
        publisher(node, Topic.STATES, Topic.STATES.of()),
    )
    for data in shapes:
        shapes_out.publish(bytes(data))
    with Child("run", "--record", str(record.with_name("own.mcap")), *options, "-p", "frame_id:=world") as child:
        wait_for(lambda: bool(states_out.get_subscription_count() and shapes_out.get_subscription_count()), child)
        steps = len(states) / seconds_of(states, messages)
        share = measured(child, steps, seconds, lambda k: states_out.publish(bytes(states[k % len(states)])))
        child.finish()
    record.with_name("own.mcap").unlink()
    for each in (shapes_out, states_out):
        node.destroy_publisher(each)
    return share


def seconds_of(states: list[Any], messages: Any) -> float:
    """Return the time from the first to the last of the recorded states (s)."""
    times = [m.log_time for m in messages if m.type == Topic.STATES.message]
    return float(times[-1] - times[0]) * 1e-9 * len(states) / (len(states) - 1)


def measured(child: Child, rate: float, seconds: float, publish: Any) -> float:
    """Publish at a rate; return the CPU after the first seconds."""
    before = 0.0
    for k in pace(rate, WARM + seconds):
        if k == round(rate * WARM):
            before, began = cpu(child.pid), time.monotonic()
        publish(k)
    return 100.0 * (cpu(child.pid) - before) / (time.monotonic() - began)


def wait_for(is_there: Any, child: Child) -> None:
    """Wait for the node, which may have to compile its kernels."""
    for _ in range(1800):
        if is_there() or not child.running():
            return
        time.sleep(0.1)
    sys.exit("the node did not start within 3 minutes")


def fed(rate: float, count: int) -> float:
    """Return the µs for each joint state of a feed without ROS."""
    feed = Feed(load_mapping(ARM / "sources.yaml"), Decoder({}))
    inputs: list[Input] = feed.begin(0)
    start = 1_700_000_000 * 10**9
    raw = [
        RawMessage("/joint_states", KIND, joint_state(start + round(k * 1e9 / rate), k / rate), 0) for k in range(count)
    ]
    began = time.process_time()
    for each in raw:
        inputs += feed.take(each)
    return (time.process_time() - began) / count * 1e6


def main() -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rate", type=float, default=500.0)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--tracks", type=int, default=0, help="tracked objects at 20 Hz beside the arm (0)")
    parser.add_argument("--executor", choices=("single", "events"), default="single", help="parameter of the node")
    arguments = parser.parse_args()
    rate, seconds = arguments.rate, arguments.seconds
    options = ["--ros-args", "-p", f"executor:={arguments.executor}"]
    os.environ["ROS_DOMAIN_ID"] = str(free_domain())
    stay_on_this_machine()
    pairs = []
    with ros_context(["arm_cost"]), tempfile.TemporaryDirectory() as folder:
        node = Node("arm_cost")
        sources = sources_file(Path(folder), arguments.tracks)
        for turn in range(arguments.turns):
            record = Path(folder) / f"{turn}.mcap"
            share = with_sources(node, rate, seconds, sources, arguments.tracks, record, options)
            pairs.append((share, without_sources(node, seconds, record, options)))
            print(f"with sources {pairs[-1][0]:.1f} %, with states {pairs[-1][1]:.1f} % of a core", flush=True)
        node.destroy_node()
    differences = [a - b for a, b in pairs]
    print(
        f"joint states at {rate:g} Hz, {arguments.tracks} tracks: {min(differences):.1f} to {max(differences):.1f} % "
        "of a core beside the monitor"
    )
    print(f"without ROS: {min(fed(rate, 5000) for _ in range(5)):.0f} µs for each message, steps at 50 Hz included")


if __name__ == "__main__":
    main()
