"""`collision-monitor world`: play a scene for the monitor to watch."""

from __future__ import annotations

import argparse
from pathlib import Path

from collision_monitor.cli.quantities import positive, whole
from collision_monitor.cli.ros_arguments import parameters
from collision_monitor.errors import InputError
from collision_monitor.pipeline.topics import NODE
from collision_monitor.ros.executables import world


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the `collision-monitor` parser."""
    parser = subparsers.add_parser(
        "world",
        help="publish a simulated scene",
        description="Publish a scene's shapes and states, at a steady rate, to a monitor on this ROS domain.",
    )
    parser.add_argument("scene", nargs="?", metavar="SCENE", help="which scene; --list shows them")
    parser.add_argument("--list", action="store_true", help="list the scenes and stop")
    parser.add_argument("--objects", type=whole(1), metavar="N", help="how many move (default: the scene's own number)")
    parser.add_argument("--rate", type=positive, metavar="HZ", help="messages per second (default: the scene's own)")
    parser.add_argument("--duration", type=positive, metavar="S", help="stop after so many seconds (default: endless)")
    parser.add_argument("--seed", type=whole(0), default=1, metavar="K", help="of the random numbers (default: 1)")
    parser.add_argument("--path", type=Path, metavar="FILE", help="recorded tracks, for the scene that plays them")
    parser.add_argument("--noise", type=positive, metavar="S", help="of the states, in m, rad, m/s and rad/s; declared")
    parser.add_argument("--monitor", default=NODE, metavar="NAME", help="the monitor node's name")
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], metavar="…", help="passed on to ROS")
    parser.set_defaults(command=play)


def play(args: argparse.Namespace) -> int:
    """Play the scene until its end, SIGINT or SIGTERM. Raises InputError."""
    from collision_monitor.world import describe, scene_names

    if args.list:
        width = max(map(len, scene_names()))
        for name in scene_names():
            print(f"{name:{width}}  {describe(name)}")
        return 0
    if args.scene is None:
        raise InputError(f"world: expected the name of a scene, one of {', '.join(scene_names())}")
    describe(args.scene)
    found = parameters(
        scene=args.scene,
        objects=args.objects,
        rate=args.rate,
        duration=args.duration,
        seed=args.seed,
        path=args.path,
        noise=args.noise,
        monitor=args.monitor,
    )
    return world(["collision-monitor", "--ros-args", *found, *args.ros_args])
