"""Tests of what all commands share: help, version, one-line errors, exit codes."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from collision_monitor._version import VERSION
from collision_monitor.cli import main as command_line
from collision_monitor.errors import SessionError

PROGRAM = Path(sys.executable).with_name("collision-monitor")


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=60)


@pytest.fixture
def command_that(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], int]], None]:
    """Replace all commands by one command, `act`, that calls the given function."""

    def make(act: Callable[[], int]) -> None:
        parser = argparse.ArgumentParser()
        parser.add_subparsers(required=True).add_parser("act").set_defaults(command=lambda _: act())
        monkeypatch.setattr(command_line, "make_parser", lambda: parser)

    return make


def test_help_names_every_command_and_shows_examples(capsys: pytest.CaptureFixture[str]) -> None:
    answer = run("--help")
    assert answer.returncode == 0
    assert answer.stderr == ""
    for name in command_line.COMMANDS:
        assert f"\n    {name}" in answer.stdout
        assert f"collision-monitor {name}" in answer.stdout
        with pytest.raises(SystemExit) as end:
            command_line.main([name, "--help"])
        assert end.value.code == 0
        assert f"collision-monitor {name}" in capsys.readouterr().out


def test_version() -> None:
    assert run("--version").stdout == f"collision-monitor {VERSION}\n"


def test_help_loads_neither_compiler_nor_ros() -> None:
    code = (
        "import sys; from collision_monitor.cli.main import make_parser; make_parser().format_help()\n"
        "print(sorted({'numba', 'scipy', 'rclpy', 'matplotlib'} & set(sys.modules)))"
    )
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"


@pytest.mark.parametrize("arguments", [[], ["no-such-command"], ["--no-such-option"]])
def test_wrong_usage_is_exit_code_2_with_the_usage(arguments: list[str]) -> None:
    answer = run(*arguments)
    assert answer.returncode == 2
    assert answer.stderr.startswith("usage: collision-monitor")
    assert "Traceback" not in answer.stderr


def test_the_exit_code_is_the_command_s(command_that: Callable[[Callable[[], int]], None]) -> None:
    command_that(lambda: 3)
    assert command_line.main(["act"]) == 3


def test_an_error_of_ours_is_one_line(
    command_that: Callable[[Callable[[], int]], None], capsys: pytest.CaptureFixture[str]
) -> None:
    def act() -> int:
        raise SessionError("run.mcap: expected a recording, found a folder")

    command_that(act)
    assert command_line.main(["act"]) == 1
    assert capsys.readouterr().err == "collision-monitor: error: run.mcap: expected a recording, found a folder\n"


def test_an_interrupt_is_quiet(
    command_that: Callable[[Callable[[], int]], None], capsys: pytest.CaptureFixture[str]
) -> None:
    def act() -> int:
        raise KeyboardInterrupt

    command_that(act)
    assert command_line.main(["act"]) == 130
    assert capsys.readouterr() == ("", "")


def test_a_reader_that_goes_away_is_no_error() -> None:
    """The reader closes the pipe, as in `collision-monitor … | head -1`, before all output is written."""
    code = (
        "import argparse, sys; from collision_monitor.cli import main as m\n"
        "p = argparse.ArgumentParser()\n"
        "act = lambda _: [print('x' * 1000) for _ in range(1000)] and 0\n"
        "p.add_subparsers().add_parser('act').set_defaults(command=act)\n"
        "m.make_parser = lambda: p\n"
        "sys.exit(m.main(['act']))"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout and process.stderr
    with process.stdout, process.stderr:
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.wait(60) == 141


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_terminal_of_another_encoding_gets_question_marks(encoding: str) -> None:
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    answer = subprocess.run([PROGRAM, "tradeoff", "--help"], capture_output=True, env=environment, timeout=60)
    assert (answer.returncode, answer.stderr) == (0, b"")
    assert b"tradeoff" in answer.stdout


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
@pytest.mark.parametrize("arguments", ["--version", "--help", "import --help"])
def test_a_full_disk_behind_a_help_is_an_error_in_one_line(arguments: str) -> None:
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with open("/dev/full", "w") as full:
        answer = subprocess.run(
            [PROGRAM, *arguments.split()], stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, env=buffered
        )
    assert (answer.returncode, answer.stderr) == (1, "collision-monitor: error: No space left on device\n")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
def test_a_full_disk_behind_stdout_is_one_line() -> None:
    with open("/dev/full", "w") as full:
        command = [PROGRAM, "world", "--list"]
        answer = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60)
    assert answer.returncode == 1
    assert answer.stderr == "collision-monitor: error: No space left on device\n"


def test_a_closed_stdout_is_no_error() -> None:
    answer = subprocess.run(
        ["sh", "-c", '"$0" world --list >&-', PROGRAM], stderr=subprocess.PIPE, text=True, timeout=60
    )
    assert (answer.returncode, answer.stderr) == (0, "")
