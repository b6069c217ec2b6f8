"""`collision-monitor view`: show a running monitor, or a session, on a page in the browser."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from collision_monitor.cli.options.quantities import whole
from collision_monitor.cli.options.usage import UsageError, check_profiles, usage
from collision_monitor.cli.output.exit_codes import ExitCode
from collision_monitor.cli.output.progress import session_bar
from collision_monitor.errors import MessageError
from collision_monitor.pipeline.topics import NODE
from collision_monitor.ros.durations import spoken
from collision_monitor.ros.process import StopRequest, ros_context, stay_on_this_machine
from collision_monitor.view.server import LOOPBACK, PORT, start_server, stop_server

SILENCE = 1.0
"""Time without answers (s) from which the page warns that it shows the past."""

DESCRIPTION = """\
Show shapes, contacts, predicted collisions with their poses of impact, and tubes of uncertainty on a
page in the browser: live from the topics of a running monitor, or from a session, with a time line to
scrub and to play. The command prints the address of the page and serves it until Ctrl-C. The page
loads nothing from other machines.
"""
EPILOG = f"""\
examples:
  collision-monitor view                             the running monitor, at http://{LOOPBACK}:{PORT}
  collision-monitor view run.mcap                    a session
  collision-monitor view run.mcap --replay exact     a session, with the answers of the profile exact
  collision-monitor view --monitor robot1/object_monitor --port 0
  collision-monitor view --host 0.0.0.0              also for other machines: anyone there can look
  collision-monitor view --allow-host robot.example  behind a proxy of that name

exit codes:
  0  stopped by Ctrl-C or SIGTERM
  1  the session cannot be read, the port is in use, or viser is not installed
  2  wrong usage
"""


def add_parser(subparsers: Any) -> None:
    """Register the command and its options."""
    parser = subparsers.add_parser(
        "view",
        help="show a running monitor or a session in the browser",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "session", type=Path, nargs="?", metavar="SESSION",
        help=".mcap file, or a folder that holds one session (default: the running monitor)",
    )  # fmt: skip
    parser.add_argument(
        "--host", default=LOOPBACK, metavar="ADDRESS", help=f"address to serve at (default: {LOOPBACK}, this machine)"
    )
    parser.add_argument(
        "--allow-host", action="append", default=[], metavar="NAME",
        help="serve the page also under this name, such as that of a proxy; can be given again "
        "(default: only this machine's own names)",
    )  # fmt: skip
    parser.add_argument(
        "--port", type=whole(0), default=PORT, metavar="N", help=f"port to serve at; 0: a free one (default: {PORT})"
    )
    parser.add_argument(
        "--replay", nargs="?", const="", metavar="PROFILE",
        help="session: show the answers of a replay, with the recorded profile or with PROFILE",
    )  # fmt: skip
    parser.add_argument(
        "--monitor", default=NODE, metavar="NAME", help=f"live: name of the monitor node (default: {NODE})"
    )
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], metavar="…", help="arguments for ROS")
    parser.set_defaults(command=view_command)


def view_command(args: argparse.Namespace) -> int:
    """Serve the page until a signal. Raises UsageError, InputError, SessionError, UnsupportedError."""
    if args.replay is not None and args.session is None:
        raise UsageError("--replay: expected a session, got none")
    if args.port > 65535:
        raise UsageError(f"--port: expected a port from 0 to 65535, got {args.port}")
    check_profiles([args.replay or ""])
    stop = StopRequest().install()
    if args.session is None:
        _view_live(args, stop)
    else:
        _view_session(args, stop)
    return ExitCode.DONE


def _view_session(args: argparse.Namespace, stop: StopRequest) -> None:
    from collision_monitor.session import Session
    from collision_monitor.view.player import Player
    from collision_monitor.view.player_controls import PlayerControls
    from collision_monitor.view.recording import RecordedSteps
    from collision_monitor.view.view import PERIOD, View

    session = Session(args.session)
    with stop.ending(), session_bar("view", session) as progress:
        recording = RecordedSteps(session, args.replay, progress)
    server = start_server(args.host, args.port, args.allow_host)
    view = View(server)
    player = Player(recording.times[-1])
    timeline = PlayerControls(server, recording, player, view.requests)
    view.panel.add_rest()
    _announce(server, args, recording.name)
    shown, last = -1, time.monotonic()
    while not stop.received:
        now = time.monotonic()
        player.advance(now - last)
        last = now
        view.answer_requests()
        frame = recording.frame_at(player.time)
        if view.is_outdated or frame != shown:
            moment = recording.moment(frame)
            title = f"{recording.name}: {recording.times[frame]:.2f} of {player.end:.2f} s, step {moment.step}"
            view.show(moment, title, recording.problems)
            shown = frame
        timeline.show()
        time.sleep(max(0.0, now + PERIOD - time.monotonic()))
    stop_server(server)


def _view_live(args: argparse.Namespace, stop: StopRequest) -> None:
    from collision_monitor.view.state_text import status_notes
    from collision_monitor.view.topic_content import TopicContent
    from collision_monitor.view.view import PERIOD, View

    server = start_server(args.host, args.port, args.allow_host)
    view = View(server)
    view.panel.add_rest()
    scene = TopicContent()
    monitor = args.monitor.strip("/")

    def take(kind: str, data: bytes) -> None:
        view.is_outdated = True
        try:
            scene.take(kind, data)
        except MessageError:  # the monitor refuses it as well, and counts it
            return

    stay_on_this_machine()
    with ros_context(["collision-monitor", *(["--ros-args", *args.ros_args] if args.ros_args else [])]):
        from collision_monitor.ros.listening.scene_listener import SceneListener

        with usage():
            listener = SceneListener(monitor, take)
        _announce(server, args, f"/{monitor}")
        while not stop.received:
            now = time.monotonic()
            view.answer_requests()
            silence = None if listener.arrived is None else now - listener.arrived
            is_silent = silence is None or silence > SILENCE
            if view.is_watched and (view.is_outdated or is_silent):
                moment = scene.moment()
                notes = status_notes(scene.status)
                if silence is None:
                    notes = [f"waiting for answers of /{monitor}"]
                elif is_silent:
                    notes.insert(0, f"NO ANSWERS for {spoken(silence)}: this is the past")
                moment = replace(moment, is_known=moment.is_known and not is_silent)
                view.show(moment, f"/{monitor}, step {moment.step}", notes)
            listener.listen(until=now + PERIOD)
        listener.close()
    stop_server(server)


def _announce(server: Any, args: argparse.Namespace, what: str) -> None:
    host = f"[{args.host}]" if ":" in args.host else args.host
    print(f"{what}: http://{host}:{server.get_port()} (Ctrl-C ends it)", flush=True)
    if args.host not in (LOOPBACK, "localhost", "::1"):
        print("anyone who reaches this address can look, without a password", flush=True)
