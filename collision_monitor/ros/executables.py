"""The executables of `ros2 run collision_monitor …`. They install their signal handlers before the slow imports."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

from collision_monitor.errors import CollisionMonitorError
from collision_monitor.ros.process import StopRequest, ros_context, spin, stay_on_this_machine

BAD_INPUT = 2
"""Exit code for impossible parameters."""


def monitor(args: Sequence[str] | None = None) -> int:
    """Run the monitor until SIGINT or SIGTERM. `args`: as sys.argv. Returns the exit code."""
    return _run(_monitor, args)


def world(args: Sequence[str] | None = None) -> int:
    """Play a scene until its end, SIGINT or SIGTERM. `args`: as sys.argv. Returns the exit code."""
    return _run(_world, args)


def guard(args: Sequence[str] | None = None) -> int:
    """Run the guard until SIGINT or SIGTERM. `args`: as sys.argv. Returns the exit code."""
    return _run(_guard, args)


def _run(body: Callable[[StopRequest], None], args: Sequence[str] | None) -> int:
    stop = StopRequest().install()
    stay_on_this_machine()
    try:
        with ros_context(args):
            body(stop)
    except CollisionMonitorError as error:
        print(f"collision-monitor: error: {error}", file=sys.stderr)
        return BAD_INPUT
    return 0


def _monitor(stop: StopRequest) -> None:
    from collision_monitor.ros.monitor.monitor_node import MonitorNode

    node = MonitorNode(stop)
    stop.on_stuck = node.save
    try:
        if node.settings.autostart:
            node.start()
        spin(node, stop, events=node.settings.executor == "events")
    finally:
        node.close()


def _guard(stop: StopRequest) -> None:
    from collision_monitor.ros.guard.guard_node import GuardNode

    node = GuardNode()
    spin(node, stop)
    node.destroy_node()


def _world(stop: StopRequest) -> None:
    from collision_monitor.ros.world_node import WorldNode

    node = WorldNode()
    node.play(stop)
    node.destroy_node()
