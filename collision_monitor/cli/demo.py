"""`collision-monitor demo`: run a scene and a monitor in two processes, show them live, then replay the session."""

from __future__ import annotations

import argparse
import os
import re
import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from collision_monitor.cli.child import PATIENCE, Child, ProcessError
from collision_monitor.cli.options.quantities import positive_number, whole
from collision_monitor.cli.options.usage import usage
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.output_file import add_force, check_outputs, writing
from collision_monitor.errors import InputError
from collision_monitor.ros.domain import free_domain
from collision_monitor.ros.process import StopRequest, ros_context, stay_on_this_machine

if TYPE_CHECKING:
    from collision_monitor.cli.output.live_table import LatestAnswers
    from collision_monitor.ros.listening.viewer import Viewer

START_PATIENCE = 180.0
"""Time for the monitor to answer (s). Its first start on a machine may have to compile the kernels."""
LOOK = 0.25
"""Time between two looks at what the monitor says while it starts (s)."""

DESCRIPTION = """\
Run a simulated scene and a monitor as two processes, and show live which objects touch now and
which will touch next.

The demo records a session. When the scene ends, it replays the session without ROS and compares
every answer byte by byte. It prints a live table in a terminal, and one line per second otherwise.
"""
EPILOG = """\
examples:
  collision-monitor demo
  collision-monitor demo --scene swarm --objects 300 --duration 30
  collision-monitor demo --scene trajectory --path tracks --output sessions/tracks.mcap

exit codes:
  0    the replay gives the same bytes
  1    a process failed, the session already exists, or a file cannot be written
  2    wrong usage, or the scene refuses an option
  3    the replay gives different answers
  4    the replay cannot be compared
  130  interrupted
"""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "demo",
        help="run a scene and a monitor, and show them live",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--scene",
        default="fleet",
        metavar="NAME",
        help="scene; `collision-monitor world --list` shows all (default: fleet)",
    )
    parser.add_argument(
        "--objects", type=whole(1), metavar="N", help="number of moving objects (default: depends on the scene)"
    )
    parser.add_argument(
        "--duration", type=positive_number, default=10.0, metavar="S", help="duration of the scene (s, default: 10)"
    )
    parser.add_argument("--seed", type=whole(0), default=1, metavar="K", help="seed of the random numbers (default: 1)")
    parser.add_argument("--path", type=Path, metavar="FILE", help="recorded tracks for the scene `trajectory`")
    parser.add_argument(
        "--noise", type=positive_number, metavar="S", help="standard deviation of the states (m, rad, m/s, rad/s)"
    )
    parser.add_argument(
        "--output", type=Path, metavar="PATH", help="new session file (default: sessions/SCENE-DATE.mcap)"
    )
    parser.add_argument("--capture", type=Path, metavar="FILE", help="save the last table as SVG")
    add_force(parser, "the file of --capture; a session is never overwritten")
    parser.set_defaults(command=demo_command)


def demo_command(args: argparse.Namespace) -> int:
    """Run the demo and return the exit code: 0 if the replay gave the same bytes.

    Raises UsageError, InputError, SessionError before anything is started or written; ProcessError.
    """
    stop = StopRequest(within=2.5 * PATIENCE, code=ExitCode.INTERRUPTED).install()  # both processes end before
    from collision_monitor.world import check_path, make_scene
    from collision_monitor.world.recorded_tracks import track_files

    with usage():
        check_path(args.scene, args.path)
        make_scene(args.scene, objects=args.objects, seed=args.seed, path=args.path, noise=args.noise or 0.0)
    if args.output is not None and args.output.exists():
        raise InputError(f"--output: expected the name of a new file, {args.output} is there already")
    outputs = {"--output": args.output, "--capture": args.capture}
    check_outputs(outputs, force=args.force, inputs=track_files(args.path))
    session = args.output or _usual_file(args.scene)
    stay_on_this_machine()
    os.environ.setdefault("ROS_DOMAIN_ID", str(free_domain()))

    recorded = _watch(args, session, stop)
    if stop.received:
        print(f"interrupted; the session is finished: {session}" if recorded else "interrupted before the scene began")
        return ExitCode.INTERRUPTED
    return _replay(session)


def _watch(args: argparse.Namespace, session: Path, stop: StopRequest) -> bool:
    """Run both processes until the session file is complete. Return False if interrupted before the scene began."""
    scene = ["world", args.scene, "--duration", str(args.duration), "--seed", str(args.seed)]
    if args.path:
        scene += ["--path", str(args.path)]
    if args.noise is not None:
        scene += ["--noise", str(args.noise)]
    if args.objects is not None:
        scene += ["--objects", str(args.objects)]
    with Child("run", "--record", str(session), *_settings(args)) as monitor, ros_context([]):
        from collision_monitor.cli.output.live_show import show_live
        from collision_monitor.ros.listening.viewer import Viewer

        viewer = Viewer()
        _wait_for_answer(viewer, monitor, stop)
        if stop.received:
            return False
        with Child(*scene) as world:
            title = f"collision_monitor, scene {args.scene}"
            picture = show_live(viewer, title, lambda: not stop.received and monitor.running() and world.running())
            if not stop.received:  # otherwise it may still be starting and has nothing to finish
                world.finish()
        monitor.finish()
        viewer.close()
        if found := re.search(r"\d+ steps, the longest took .*", monitor.words()):  # its log
            print(f"steps    {found[0]}")
    if args.capture is not None and not stop.received:
        _capture(picture, args.capture)
    return True


def _settings(args: argparse.Namespace) -> list[str]:
    """Options of the monitor. Without --noise no state is uncertain, and the kernels for that need not be compiled."""
    return [] if args.noise is not None else ["--ros-args", "-p", "uncertainty:=false"]


def _wait_for_answer(viewer: Viewer, monitor: Child, stop: StopRequest) -> None:
    """Wait for the first status, which the monitor publishes as soon as it listens. Raises ProcessError."""
    began, said = time.monotonic(), ""
    while viewer.status is None and not stop.received:
        viewer.listen(until=time.monotonic() + LOOK)
        monitor.running()
        if (found := re.findall(r"compiling .*", monitor.words())) and found[-1] != said:
            said = found[-1]
            print(f"the monitor is {said}", flush=True)
        if time.monotonic() > began + START_PATIENCE:
            raise ProcessError(f"collision-monitor run: expected a status within {START_PATIENCE:g} s, got none")


def _capture(picture: LatestAnswers, path: Path) -> None:
    from rich.console import Console

    with open(os.devnull, "w") as nowhere:
        console = Console(record=True, width=100, file=nowhere)
        console.print(picture.table())
    with writing(path):
        console.save_svg(str(path), title="collision-monitor demo")


def _usual_file(scene: str) -> Path:
    """Return the path of a new file in the usual folder, and create the folder. Raises InputError."""
    folder = Path("sessions")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: expected a folder that can be written, got: {error.strerror}") from None
    return folder / f"{scene}-{datetime.now():%Y%m%d-%H%M%S}.mcap"


def _replay(session: Path) -> int:
    """Replay without ROS, compare, and print the last lines of the demo. Return the exit code."""
    from collision_monitor.session import Session
    from collision_monitor.session.replaying.replay import replay
    from collision_monitor.session.replaying.replay_report import Verdict

    recorded = Session(session)
    report = replay(recorded)
    size = f"{recorded.size / 1e6:.1f} MB" if recorded.size >= 1e6 else f"{recorded.size / 1e3:.0f} kB"
    print(f"session  {session} ({report.messages} messages, {size})")
    if report.verdict is Verdict.IDENTICAL:
        print(
            f"replay   bit-identical: {report.steps} steps in {report.replay_duration:.1f} s without ROS "
            f"({report.speed:.0f} × real time), digest {report.digest:016x}"
        )
        return ExitCode.DONE
    for line in (report.first_difference, *report.notes):
        if line is not None:
            print(f"replay   {line}")
    print(f"replay   NOT identical: {report.verdict.name.lower().replace('_', ' ')}")
    return int(report.verdict)
