"""`collision-monitor demo`: a scene and a monitor in processes of their own, watched live, then replayed."""

from __future__ import annotations

import argparse
import os
import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from collision_monitor.cli.child import Child, ProcessError
from collision_monitor.cli.exit_codes import ExitCode
from collision_monitor.cli.quantities import positive, whole
from collision_monitor.errors import InputError
from collision_monitor.ros.domain import free_domain
from collision_monitor.ros.process import StopRequest, ros_context, stay_on_this_machine

if TYPE_CHECKING:
    from collision_monitor.cli.live_table import Picture
    from collision_monitor.ros.viewer import Viewer

START_PATIENCE = 180.0
"""s for the monitor to answer; the first start on a machine may have to compile its kernels."""
FRAME = 0.25
"""s between two pictures."""
LINE = 1.0
"""s between two lines where the output is no terminal."""


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the `collision-monitor` parser."""
    parser = subparsers.add_parser(
        "demo",
        help="a scene and a monitor, live in this terminal",
        description="Start a monitor and a scene as two processes, show what touches now and what will touch next, "
        "record it, then replay the recording without ROS and compare every answer.",
    )
    parser.add_argument("--scene", default="fleet", metavar="NAME", help="see `world --list` (default: fleet)")
    parser.add_argument("--objects", type=whole(1), metavar="N", help="how many move (default: the scene's own number)")
    parser.add_argument("--duration", type=positive, default=10.0, metavar="S", help="seconds (default: 10)")
    parser.add_argument("--seed", type=whole(0), default=1, metavar="K", help="of the random numbers (default: 1)")
    parser.add_argument("--path", metavar="FILE", help="recorded tracks, for the scene `trajectory`")
    parser.add_argument("--noise", type=positive, metavar="S", help="of the states, see `world --help`")
    parser.add_argument("--output", type=Path, metavar="PATH", help="session file (default: sessions/SCENE-DATE.mcap)")
    parser.add_argument("--capture", type=Path, metavar="FILE", help="save the last picture of the table as SVG")
    parser.set_defaults(command=demo_command)


def demo_command(args: argparse.Namespace) -> int:
    """Exit code 0 only where everything worked and the replay gave the same bytes. Raises ProcessError, InputError."""
    stop = StopRequest().install()
    from collision_monitor.world import describe

    describe(args.scene)
    session = _new_file(args.output, args.scene)
    stay_on_this_machine()
    os.environ.setdefault("ROS_DOMAIN_ID", str(free_domain()))

    recorded = _watch(args, session, stop)
    if stop.received:
        print(f"interrupted; the session is finished: {session}" if recorded else "interrupted before the scene began")
        return ExitCode.INTERRUPTED
    return _replay(session)


def _watch(args: argparse.Namespace, session: Path, stop: StopRequest) -> bool:
    """From the start of both processes to the finished session file. False: interrupted before there was one."""
    scene = ["world", args.scene, "--duration", str(args.duration), "--seed", str(args.seed)]
    if args.path:
        scene += ["--path", args.path]
    if args.noise is not None:
        scene += ["--noise", str(args.noise)]
    if args.objects is not None:
        scene += ["--objects", str(args.objects)]
    with Child("run", "--record", str(session)) as monitor, ros_context([]):
        from collision_monitor.ros.viewer import Viewer

        viewer = Viewer()
        _wait_for_answer(viewer, monitor, stop)
        if stop.received:
            return False
        with Child(*scene) as world:
            picture = _show(viewer, args.scene, [monitor, world], stop)
            if not stop.received:  # else it may be starting still, and has nothing to finish
                world.finish()
        monitor.finish()
        viewer.close()
    if args.capture is not None and not stop.received:
        _capture(picture, args.capture)
    return True


def _wait_for_answer(viewer: Viewer, monitor: Child, stop: StopRequest) -> None:
    """Until the first status: the monitor publishes one as soon as it listens."""
    patience = time.monotonic() + START_PATIENCE
    while viewer.status is None and not stop.received:
        viewer.listen(until=time.monotonic() + FRAME)
        monitor.running()
        if time.monotonic() > patience:
            raise ProcessError(f"collision-monitor run: expected a status within {START_PATIENCE:g} s, got none")


def _show(viewer: Viewer, scene: str, children: list[Child], stop: StopRequest) -> Picture:
    """Draw until the scene is over; the last picture."""
    from rich.console import Console
    from rich.live import Live

    console = Console()
    period = FRAME if console.is_terminal else LINE
    began = time.monotonic()
    frame, heard_at = 0, None
    picture = _picture(viewer, scene, 0.0)
    with Live(console=console, auto_refresh=False, transient=True) as live:
        while not stop.received and all([child.running() for child in children]):
            frame += 1
            viewer.listen(until=began + frame * period)
            if viewer.contacts is None:
                continue
            heard_at = heard_at or time.monotonic()
            picture = _picture(viewer, scene, time.monotonic() - heard_at)
            if console.is_terminal:
                live.update(picture.table(), refresh=True)
            else:
                print(picture.line(), flush=True)
    if console.is_terminal:
        console.print(picture.table())
    return picture


def _picture(viewer: Viewer, scene: str, elapsed: float) -> Picture:
    from collision_monitor import codec
    from collision_monitor.cli.live_table import Picture

    return Picture(
        title=f"collision_monitor, scene {scene}",
        elapsed=elapsed,
        contacts=None if viewer.contacts is None else codec.decode_contacts(viewer.contacts),
        predictions=None if viewer.predictions is None else codec.decode_predictions(viewer.predictions),
        status=codec.MonitorStatus() if viewer.status is None else codec.decode_status(viewer.status),
    )


def _capture(picture: Picture, path: Path) -> None:
    from rich.console import Console

    with open(os.devnull, "w") as nowhere:
        console = Console(record=True, width=100, file=nowhere)
        console.print(picture.table())
    console.save_svg(str(path), title="collision-monitor demo")


def _new_file(chosen: Path | None, scene: str) -> Path:
    """A path where no file is yet, in a folder that exists. Raises InputError."""
    if chosen is None:
        chosen = Path("sessions") / f"{scene}-{datetime.now():%Y%m%d-%H%M%S}.mcap"
    if chosen.exists():
        raise InputError(f"--output: expected the name of a new file, {chosen} is there already")
    try:
        chosen.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--output: expected to be able to write {chosen.parent}, got: {error.strerror}") from None
    return chosen


def _replay(session: Path) -> int:
    """Replay without ROS and compare; the last lines of the demo."""
    from collision_monitor.session import Session
    from collision_monitor.session.replaying.replay import replay
    from collision_monitor.session.replaying.replay_report import Verdict

    report = replay(Session(session))
    size = session.stat().st_size / 1e6
    print(f"session  {session} ({report.messages} messages, {size:.1f} MB)")
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
