"""Measure the sources: the cost of each message, and the latency from a stamp to the prediction over DDS.

    .venv/bin/python benchmarks/sources.py                 # CPU of each message, in this process
    .venv/bin/python benchmarks/sources.py --live 20       # a node, and a robot with tracks around it, for 20 s

The first part feeds 200 tracked objects in the frame of a moving robot, odometry, transforms and a cloud of 20,000
points to a `Feed`, and prints median and p99 of the CPU time of each. The second plays a robot that drives among
tracked people (10 Hz), with odometry at 50 Hz, to a node with a sources file. It prints the latency from the stamp of
each odometry message to the receipt of its predictions, and the CPU time of the node.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "test" / "helpers"))

from foreign_bag import STORE, T, odometry, pose, transforms
from foreign_messages import AUTOWARE, CYLINDER, decoder, point_cloud, predicted_objects, track, tracked_objects

from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.topics import Topic
from collision_monitor.sources import Feed, RawMessage, load_mapping

TRACKS = 200
FILE = """\
frame: map
{step}
objects:
  robot:  {{topic: /odom, shape: {{box: [1.0, 0.7, 0.5]}}}}
  people: {{topic: /tracks}}
"""
SCAN_FILE = """\
frame: map
rate: 20
objects:
  robot: {{topic: /odom, shape: {{box: [1.0, 0.7, 0.5]}}}}
  scan:  {{topic: /points, radius: 0.05{options}}}
"""
SCANS = {
    "20,000 points": "",
    "20,000 points, voxel 0.5": ", voxel: 0.5",
    "20,000 points, without robot": ", without: [robot]",
}
COVARIANCE = np.diag([0.01] * 6)


def people(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (count, 2) in m around the robot, and velocities."""
    return rng.uniform(-30, 30, (count, 2)), rng.uniform(-1.2, 1.2, (count, 2))


def seen(p: np.ndarray, v: np.ndarray, t: float, stamp: int, frame: str = "map") -> tuple[str, Any]:
    """TrackedObjects of people that walk straight on."""
    each = [
        track(k + 1, (*(p[k] + v[k] * t), 0.9), linear=(*v[k], 0), kind=CYLINDER, size=(0.6, 0.6, 1.8), label=7,
              pose_covariance=COVARIANCE, twist_covariance=COVARIANCE)
        for k in range(len(p))
    ]  # fmt: skip
    return tracked_objects(frame, stamp, *each)


def raw(topic: str, message: tuple[str, Any], received: int = 0) -> RawMessage:
    """The bytes of a message."""
    kind, content = message
    return RawMessage(topic, kind, bytes(STORE.serialize_cdr(content, kind)), received)


def costs(file: Path) -> dict[str, tuple[float, float]]:
    """Median and p99 of the CPU time (ms) of each kind of message."""
    file.write_text(FILE.format(step="rate: 20"))
    feed = Feed(load_mapping(file), decoder())
    p, v = people(np.random.default_rng(1), TRACKS)
    start, found = 10**18, {"tf": [], "odometry": [], f"{TRACKS} tracks": []}  # type: ignore[var-annotated]
    feed.bind("/odom", "nav_msgs/msg/Odometry")
    feed.bind("/tracks", "autoware_perception_msgs/msg/TrackedObjects")
    feed.begin(0)
    for k in range(600):
        t, stamp = k * 0.05, start + k * 50_000_000
        each = {
            "tf": raw("/tf", transforms(stamp, ("map", "base", (t, 0, 0), (0, 0, 0, 1)))),
            "odometry": raw("/odom", odometry("base", stamp, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))),
            f"{TRACKS} tracks": raw("/tracks", seen(p, v, t, stamp, "base")),
        }
        for name, message in each.items():
            found[name].append(cpu(lambda message=message: feed.take(message)))
    for name, options in SCANS.items():
        found[name] = scan_costs(file, options)
    for paths in ("all", "likeliest", "ignored"):
        found[f"{TRACKS} predicted, paths {paths}"] = predicted_costs(file, paths)
    return {name: (float(np.median(times)), float(np.percentile(times, 99))) for name, times in found.items()}


def scan_costs(file: Path, options: str) -> list[float]:
    """CPU time (ms) of each message of a cloud of 20,000 points that a robot carries, until the monitor gets it."""
    file.write_text(SCAN_FILE.format(options=options))
    feed = Feed(load_mapping(file), decoder())
    start, rng, times = 10**18, np.random.default_rng(2), []
    kind, cloud = point_cloud("map", start, rng.uniform(-20, 20, (20_000, 3)))
    feed.bind("/odom", "nav_msgs/msg/Odometry")
    feed.bind("/points", kind)
    feed.begin(0)
    for k in range(200):
        stamp = start + k * 100_000_000
        cloud.header.stamp.sec, cloud.header.stamp.nanosec = divmod(stamp, 10**9)
        feed.take(raw("/odom", odometry("map", stamp, (0, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))))
        message = raw("/points", (kind, cloud))
        times.append(cpu(lambda message=message: feed.take(message)))
    return times


def predicted_costs(file: Path, paths: str) -> list[float]:
    """CPU time (ms) of each message of objects with three paths of 20 poses, until the monitor has their plans."""
    file.write_text(f"frame: map\nobjects:\n  people: {{topic: /predicted, paths: {paths}}}\n")
    feed, pipeline = Feed(load_mapping(file), decoder()), Pipeline("balanced", "map")
    p, v = people(np.random.default_rng(1), TRACKS)
    duration, start, times = T["builtin_interfaces/msg/Duration"](0, 500_000_000), 10**18, []
    feed.bind("/predicted", AUTOWARE + "PredictedObjects")
    take = {
        Topic.SHAPES: pipeline.on_shapes, Topic.TRAJECTORIES: pipeline.on_trajectories, Topic.STATES: lambda data: None
    }  # fmt: skip

    def process(message: RawMessage) -> None:
        for each in feed.take(message):
            take[each.topic](each.data)

    feed.begin(0)
    for k in range(40):
        stamp, objects = start + k * 100_000_000, []
        for number in range(TRACKS):
            here = p[number] + 0.1 * k * v[number]
            one = track(number, (*here, 0.9), linear=(*v[number], 0), label=7, kind=CYLINDER, predicted=True)
            one.kinematics.predicted_paths = [
                T[AUTOWARE + "PredictedPath"](
                    [pose((*(here + 0.5 * j * v[number]), 0.9 + 0.01 * turn * j)) for j in range(20)], duration, 0.5
                )
                for turn in range(3)
            ]
            objects.append(one)
        message = raw("/predicted", predicted_objects("map", stamp, *objects))
        times.append(cpu(lambda message=message: process(message)))
    return times


def cpu(work: Callable[[], object]) -> float:
    """CPU time of a call in ms."""
    began = time.thread_time()
    work()
    return (time.thread_time() - began) * 1e3


def live(file: Path, seconds: float, tracks: int) -> dict[str, float]:
    """Play to a node; return latencies in ms and the share of one core that the node uses."""
    import rclpy
    from autoware_perception_msgs.msg import TrackedObjects
    from nav_msgs.msg import Odometry

    from collision_monitor.codec import decode_predictions
    from collision_monitor.pipeline.topics import Topic
    from collision_monitor.ros.endpoints import subscription

    file.write_text(FILE.format(step="step: /odom"))
    node_process = subprocess.Popen(
        [sys.executable, "-m", "collision_monitor", "run", "--sources", file, "--record", file.with_suffix(".mcap")]
    )
    rclpy.init()
    node = rclpy.create_node("robot")
    out = node.create_publisher(Odometry, "/odom", 10), node.create_publisher(TrackedObjects, "/tracks", 10)
    latencies: list[float] = []
    hits = 0

    def receive(data: bytes) -> None:
        nonlocal hits
        message = decode_predictions(data)
        latencies.append(time.time() - message.stamp_ns * 1e-9)
        hits += len(message.predictions)

    subscription(node, Topic.PREDICTIONS, receive, Topic.PREDICTIONS.of())
    while not all(each.get_subscription_count() for each in out):
        rclpy.spin_once(node, timeout_sec=0.1)
    time.sleep(1.0)
    p, v = people(np.random.default_rng(1), tracks)
    prepared = [seen(p, v, k * 0.05, 0)[1] for k in range(20)]  # making them costs more than the node
    began, used = time.monotonic(), cpu_of(node_process.pid)
    tick = 0
    while time.monotonic() - began < seconds:
        t, stamp = tick * 0.02, time.time_ns()
        if tick % 5 == 0:
            kind = "autoware_perception_msgs/msg/TrackedObjects"
            message = prepared[tick // 5 % 20]
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            out[1].publish(bytes(STORE.serialize_cdr(message, kind)))
        kind, content = odometry("map", time.time_ns(), (t % 20, 0, 0), (0, 0, 0, 1), (1, 0, 0), (0, 0, 0))
        out[0].publish(bytes(STORE.serialize_cdr(content, kind)))
        tick += 1
        while (left := began + tick * 0.02 - time.monotonic()) > 0.0:
            rclpy.spin_once(node, timeout_sec=left)
    elapsed, used = time.monotonic() - began, cpu_of(node_process.pid) - used
    node_process.terminate()
    node_process.wait()
    node.destroy_node()
    rclpy.shutdown()
    given = np.array(latencies[50:]) * 1e3
    return {
        "odometry messages": tick,
        "steps": len(latencies),
        "predictions": hits,
        "latency median ms": float(np.median(given)),
        "latency p99 ms": float(np.percentile(given, 99)),
        "node share of a core": used / elapsed,
    }


def cpu_of(pid: int) -> float:
    """CPU time of a process so far (s)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / 100.0


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--live", type=float, metavar="S", help="play to a node for S seconds")
    parser.add_argument("--tracks", type=int, default=12, help="tracked people in the live part (12)")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sources.yaml"
        if args.live:
            print(json.dumps(live(file, args.live, args.tracks), indent=2))
            return
        for name, (median, most) in costs(file).items():
            print(f"{name:28} median {median:7.3f} ms   p99 {most:7.3f} ms")


if __name__ == "__main__":
    main()
