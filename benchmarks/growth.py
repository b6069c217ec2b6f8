"""Send hostile messages to a node over DDS and measure where its memory grows.

    python benchmarks/growth.py                       two rounds of every attack, two minutes
    python benchmarks/growth.py --count 20000 --rounds 4 --attacks noise unknown
    python benchmarks/growth.py --burst --stall --attacks oversized

Each attack is a kind of message that the node refuses. Anonymous memory is the heap: of Python, NumPy, numba and DDS.
Shared memory is that of Fast DDS: the segments of this process and of the node, mapped page by page as messages pass
through them. A growth that comes in the first rounds alone is a cache or a pool that fills: Fast DDS keeps a buffer
for each message that ever waited unread, so up to the depth of the queue times the largest message. One that comes in
each round is a leak. All traffic stays on this machine, in a ROS domain of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from collision_monitor import codec, records
from collision_monitor.cli.child import Child, ProcessError
from collision_monitor.codec import Removal
from collision_monitor.errors import CollisionMonitorError, Refusal
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.topics import Topic
from collision_monitor.ros.domain import free_domain
from collision_monitor.ros.process import ros_context, stay_on_this_machine
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import ConvexHull, Sphere

LONGEST: Final = 30.0
"""s that one attack may take; then the rest of its messages is left out."""

SETTLES: Final = 4.0
"""s after an attack until the memory is read, so that the node has processed what it received."""

STALL: Final = 1.0
"""s that the node stays stopped after the last message."""

START_PATIENCE: Final = 180.0
"""s to wait for the monitor, which may have to compile its kernels."""

Random = np.random.Generator
Message = tuple[Topic, bytes]


def noise(random: Random, _: int) -> Message:
    """Random bytes, up to 1 kB."""
    return _either(random), b"\0\1\0\0" + random.bytes(int(random.integers(1, 1000)))


def oversized(random: Random, _: int) -> Message:
    """Bytes that are no message, 1 MB of them, on the topic of shapes."""
    return Topic.SHAPES, b"\0\1\0\0" + random.bytes(1_000_000)


def oversized_states(random: Random, _: int) -> Message:
    """Bytes that are no message, 1 MB of them, on the topic of states."""
    return Topic.STATES, b"\0\1\0\0" + random.bytes(1_000_000)


def unknown(random: Random, k: int) -> Message:
    """States of 1,000 objects that were never described."""
    states = np.zeros(1000, records.STATE)
    states["id"], states["quaternion"][:, 3] = random.integers(1000, 2**32, 1000), 1.0
    return Topic.STATES, codec.encode_states(time.time_ns(), "world", k, states)


def frames(random: Random, k: int) -> Message:
    """States in frames with random names of 200 letters."""
    return Topic.STATES, codec.encode_states(time.time_ns(), random.bytes(100).hex(), k, np.zeros(1, records.STATE))


def names(random: Random, k: int) -> Message:
    """Descriptions of one object with random names of 200 letters, and its removal."""
    ball = ObjectDescription(7, ((Sphere(0.5), Pose()),), name=random.bytes(100).hex())
    return Topic.SHAPES, codec.encode_descriptions(0, "world", [ball, Removal(7)] if k % 2 else [ball])


def hulls(random: Random, k: int) -> Message:
    """Descriptions of one object as hulls of 200 random points, and its removal."""
    hull = ObjectDescription(8, ((ConvexHull(random.normal(0, 1, (200, 3))), Pose()),))
    return Topic.SHAPES, codec.encode_descriptions(0, "world", [hull, Removal(8)] if k % 2 else [hull])


ATTACKS: Final[dict[str, Callable[[Random, int], Message]]] = {
    attack.__name__: attack for attack in (noise, unknown, frames, names, hulls, oversized_states, oversized)
}

SHARE: Final = {"oversized": 0.1, "oversized_states": 0.1, "hulls": 0.2}
"""Messages of an attack as a share of --count, where they are large or slow to make."""


def _either(random: Random) -> Topic:
    return Topic.STATES if random.random() < 0.5 else Topic.SHAPES


def memory(pid: int) -> dict[str, float]:
    """Resident memory of a process by its kind, in MB (proc(5), status)."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    fields = dict(line.split(":", 1) for line in lines if line.startswith("Rss"))
    kinds = {"heap": "RssAnon", "shared": "RssShmem", "files": "RssFile"}
    return {name: int(fields[field].split()[0]) / 1024 for name, field in kinds.items()}


class Attacker:
    """Publishes bytes on the topics of a node."""

    def __init__(self) -> None:
        from rclpy import create_node
        from rclpy.executors import SingleThreadedExecutor

        from collision_monitor.ros.endpoints import publisher, subscription

        self._node = create_node("attacker")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._status: bytes | None = None
        subscription(self._node, Topic.STATUS, self._on_status, Topic.STATUS.of())
        self._out: dict[Topic, Any] = {
            topic: publisher(self._node, topic, topic.of()) for topic in (Topic.SHAPES, Topic.STATES)
        }

    def _on_status(self, data: bytes) -> None:
        self._status = data

    @property
    def refused(self) -> int:
        """Inputs that the node has refused: messages, states and shapes."""
        status = codec.decode_status(self._status or b"")
        return sum(getattr(status, f"refused_{reason.value}") for reason in Refusal)

    def settle(self) -> None:
        """Wait until the node has processed what it received."""
        until = time.monotonic() + SETTLES
        while time.monotonic() < until:
            self._executor.spin_once(timeout_sec=0.1)

    def wait_for(self, monitor: Child) -> None:
        """Wait until the monitor has discovered both topics. Raises ProcessError."""
        deadline = time.monotonic() + START_PATIENCE
        while not all(out.get_subscription_count() for out in self._out.values()):
            if not monitor.running() or time.monotonic() > deadline:
                raise ProcessError(
                    f"collision-monitor run: expected a subscriber within {START_PATIENCE:g} s, got none"
                )
            time.sleep(0.1)
        self.settle()

    def send(self, attack: str, count: int, random: Random, *, pauses: bool) -> int:
        """Send the messages of an attack for at most LONGEST; returns how many."""
        deadline = time.monotonic() + LONGEST
        for k in range(count):
            topic, data = ATTACKS[attack](random, k)
            self._out[topic].publish(data)
            if pauses:
                time.sleep(max(1e-3, len(data) * 2e-8))  # 1 MB in 20 ms
            if time.monotonic() > deadline:
                return k + 1
        return count

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self._node.destroy_node()


def measure(
    attacks: Sequence[str], count: int, rounds: int, seed: int, *, pauses: bool, stall: bool
) -> list[dict[str, Any]]:
    """Return the memory (MB) at the start and after each attack. Raises ProcessError if the node fails."""
    random = np.random.default_rng(seed)
    with Child("run") as monitor, ros_context([]):
        attacker = Attacker()
        attacker.wait_for(monitor)
        rows: list[dict[str, Any]] = [{"round": 0, "attack": "", "sent": 0, "refused": 0, **memory(monitor.pid)}]
        for each in range(1, rounds + 1):
            for attack in attacks:
                if stall:
                    os.kill(monitor.pid, signal.SIGSTOP)
                sent = attacker.send(attack, round(count * SHARE.get(attack, 1.0)), random, pauses=pauses)
                if stall:
                    time.sleep(STALL)
                    os.kill(monitor.pid, signal.SIGCONT)
                attacker.settle()
                monitor.running()
                counts = {"sent": sent, "refused": attacker.refused}
                rows.append({"round": each, "attack": attack, **counts, **memory(monitor.pid)})
        attacker.close()
        monitor.finish()
    return rows


def main() -> int:
    """Return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000, metavar="N", help="messages of an attack (default: 2000)")
    parser.add_argument("--rounds", type=int, default=2, metavar="N", help="(default: 2)")
    parser.add_argument("--attacks", nargs="+", choices=ATTACKS, default=list(ATTACKS), help="(default: all)")
    parser.add_argument("--burst", action="store_true", help="send without pauses")
    parser.add_argument("--stall", action="store_true", help="stop the node while messages are sent, like a long step")
    parser.add_argument("--seed", type=int, default=1, metavar="K", help="seed of the messages (default: 1)")
    parser.add_argument("--json", action="store_true", help="print JSON in place of the table")
    args = parser.parse_args()
    try:
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        stay_on_this_machine()
        os.environ["ROS_DOMAIN_ID"] = str(free_domain())
        rows = measure(args.attacks, args.count, args.rounds, args.seed, pauses=not args.burst, stall=args.stall)
    except CollisionMonitorError as error:
        print(f"growth: error: {error}", file=sys.stderr)
        return 1
    if args.json:
        print(json.dumps(rows))
        return 0
    print(f"{'round':>5}  {'attack':16}  {'sent':>6}  {'refused':>9}  {'heap':>6}  {'shared':>6}  {'files':>6}  [MB]")
    for row in rows:
        print(
            f"{row['round']:5}  {row['attack']:16}  {row['sent']:6}  {row['refused']:9}  "
            f"{row['heap']:6.1f}  {row['shared']:6.1f}  {row['files']:6.1f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
