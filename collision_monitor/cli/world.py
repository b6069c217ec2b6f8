"""`collision-monitor world`: publish a simulated scene to a monitor."""

from __future__ import annotations

import argparse
from pathlib import Path

from collision_monitor.cli.options.quantities import not_negative, positive_number, whole
from collision_monitor.cli.options.ros_arguments import parameters
from collision_monitor.cli.options.usage import UsageError, usage
from collision_monitor.pipeline.topics import NODE
from collision_monitor.ros.executables import world
from collision_monitor.world.rigid.response_choice import METHODS

DESCRIPTION = """\
Publish a simulated scene on this ROS domain: the shapes of the objects once, then their states at
a steady rate. A monitor node observes it. The command prints ROS log messages.
"""
EPILOG = """\
examples:
  collision-monitor world --list
  collision-monitor world fleet --objects 200 --noise 0.005
  collision-monitor world billiards --response damped --restitution 0.8
  collision-monitor world trajectory --path tracks --duration 60

exit codes:
  0  the scene ended, or was stopped by Ctrl-C or SIGTERM
  2  wrong usage, or the scene refuses an option
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "world",
        help="publish a simulated scene",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("scene", nargs="?", metavar="SCENE", help="name of the scene")
    parser.add_argument("--list", action="store_true", help="print the names of all scenes and exit")
    parser.add_argument(
        "--objects", type=whole(1), metavar="N", help="number of moving objects (default: depends on the scene)"
    )
    parser.add_argument(
        "--rate", type=positive_number, metavar="HZ", help="messages per second (Hz, default: depends on the scene)"
    )
    parser.add_argument(
        "--duration", type=positive_number, metavar="S", help="stop after this time (s, default: never)"
    )
    parser.add_argument("--seed", type=whole(0), default=1, metavar="K", help="seed of the random numbers (default: 1)")
    parser.add_argument("--path", type=Path, metavar="FILE", help="recorded tracks for the scene `trajectory`")
    parser.add_argument(
        "--noise",
        type=positive_number,
        metavar="S",
        help="standard deviation of the states, which declare it (m, rad, m/s, rad/s)",
    )
    parser.add_argument(
        "--restitution", type=not_negative, metavar="E", help="bounce of bodies that respond, 0 (none) to 1 (elastic)"
    )
    parser.add_argument(
        "--gravity", type=not_negative, metavar="G", help="gravity along -z in these scenes (m/s², default: 9.81)"
    )
    parser.add_argument(
        "--response", choices=METHODS, help="what bodies do when they meet in these scenes (default: impulse)"
    )
    parser.add_argument(
        "--monitor", default=NODE, metavar="NAME", help="name of the monitor node (default: object_monitor)"
    )
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], metavar="…", help="arguments for ROS")
    parser.set_defaults(command=publish_scene)


def publish_scene(args: argparse.Namespace) -> int:
    """Publish the scene until its end, SIGINT or SIGTERM, and return the exit code. Raises UsageError."""
    from collision_monitor.world import check_path, describe, scene_names

    if args.list:
        width = max(map(len, scene_names()))
        for name in scene_names():
            print(f"{name:{width}}  {describe(name)}")
        return 0
    if args.scene is None:
        raise UsageError(f"world: expected the name of a scene, one of {', '.join(scene_names())}")
    with usage():
        describe(args.scene)
        check_path(args.scene, args.path)
    found = parameters(
        scene=args.scene,
        objects=args.objects,
        rate=args.rate,
        duration=args.duration,
        seed=args.seed,
        path=args.path,
        noise=args.noise,
        restitution=args.restitution,
        gravity=args.gravity,
        response=args.response,
        monitor=args.monitor,
    )
    return world(["collision-monitor", "--ros-args", *found, *args.ros_args])
