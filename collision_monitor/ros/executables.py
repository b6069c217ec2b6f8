"""The executables of `ros2 run collision_monitor …`. They install their signal handlers before the slow imports."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Final

from collision_monitor.errors import CollisionMonitorError
from collision_monitor.ros.process import StopRequest, ros_context, spin, stay_on_this_machine

BAD_INPUT = 2
"""Exit code for impossible parameters."""


def monitor(args: Sequence[str] | None = None) -> int:
    """Run the monitor until SIGINT or SIGTERM, or print its help. `args`: as sys.argv. Returns the exit code."""
    return _run(_monitor, args, lambda: _NODE_HELP.format(name="monitor", command="run"))


def world(args: Sequence[str] | None = None) -> int:
    """Play a scene until its end or a signal, or print its help. `args`: as sys.argv. Returns the exit code."""
    return _run(_world, args, lambda: _NODE_HELP.format(name="world", command="world"))


def guard(args: Sequence[str] | None = None) -> int:
    """Run the guard until SIGINT or SIGTERM, or print its help. `args`: as sys.argv. Returns the exit code."""
    return _run(_guard, args, _guard_help)


def gate(args: Sequence[str] | None = None) -> int:
    """Run the gate until SIGINT or SIGTERM, or print its help. `args`: as sys.argv. Returns the exit code."""
    return _run(_gate, args, _gate_help)


_NODE_HELP: Final = """\
usage: {name} [--help] [--ros-args -p NAME:=VALUE ... -r FROM:=TO ...]

The node that `collision-monitor {command}` runs, for `ros2 run collision_monitor {name}` and launch files.
`collision-monitor {command} --help` explains it; docs/node.md lists the parameters of the monitor.
"""


def _guard_help() -> str:
    from collision_monitor.ros.guard.guard_options import guard_help

    return guard_help()


def _gate_help() -> str:
    from collision_monitor.ros.gate.gate_options import gate_help

    return gate_help()


def wants_help(arguments: Sequence[str]) -> bool:
    """Return whether a command line (as sys.argv) asks for help, before the arguments of ROS."""
    own = list(arguments[1:])
    own = own[: own.index("--ros-args")] if "--ros-args" in own else own
    return "--help" in own or "-h" in own


def _run(body: Callable[[StopRequest], None], args: Sequence[str] | None, text: Callable[[], str]) -> int:
    if wants_help(sys.argv if args is None else args):
        print(text(), end="")
        return 0
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
    try:
        spin(node, stop)
    finally:
        node.close()


def _gate(stop: StopRequest) -> None:
    from collision_monitor.ros.gate.gate_node import GateNode

    node = GateNode()
    try:
        spin(node, stop)
    finally:
        node.close()


def _world(stop: StopRequest) -> None:
    from collision_monitor.ros.world_node import WorldNode

    node = WorldNode()
    node.play(stop)
    node.destroy_node()
