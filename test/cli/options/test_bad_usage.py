"""Tests of wrong usage: one line with the expected input, no traceback, and a distinct exit code."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from collision_monitor.cli.main import main, make_parser
from collision_monitor.cli.options.parameter_file import check_parameter_file
from collision_monitor.errors import InputError
from collision_monitor.session import many_sessions as many

PROGRAM = Path(sys.executable).with_name("collision-monitor")
GOLDEN = Path(__file__).parents[2] / "golden" / "balanced.mcap"
EXAMPLE = Path(__file__).parents[3] / "config" / "monitor.yaml"


@pytest.mark.parametrize(
    "arguments",
    [
        ("world", "fleet", "--objects", "0"),
        ("world", "fleet", "--objects", "-3"),
        ("world", "fleet", "--rate", "0"),
        ("world", "fleet", "--rate", "nan"),
        ("world", "fleet", "--duration", "-1"),
        ("world", "fleet", "--seed", "-1"),
        ("demo", "--objects", "many"),
        ("demo", "--duration", "inf"),
        ("bench", "--frames", "0"),
        ("bench", "--frames", "2"),
        ("bench", "--n", "0"),
        ("bench", "--n", "99999999999"),
        ("compare", "a", "b", "--tolerance", "-1"),
    ],
    ids=" ".join,
)
def test_numbers_out_of_range_are_wrong_usage(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        make_parser().parse_args(arguments)
    assert stopped.value.code == 2
    error = capsys.readouterr().err.splitlines()[-1]  # the line below the usage
    assert "expected a" in error and f"got {arguments[-1]!r}" in error


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("world", "fleet", "--monitor", "bad name"), "letters, digits and underscores, got 'bad name'"),
    ],
    ids=["node name"],
)
def test_no_traceback(arguments: tuple[str, ...], words: str) -> None:
    answer = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True, timeout=60)
    assert answer.returncode in (1, 2)
    assert words in answer.stderr
    assert "Traceback" not in answer.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("compare", "none.mcap", "--profile", "nope"), "expected one of balanced, exact, fast"),
        (("compare", "none.mcap"), "expected two sessions"),
        (("world", "nope"), "scene: expected one of"),
        (("demo", "--scene", "nope"), "scene: expected one of"),
        (("demo", "--noise", "5"), "noise: expected more than 0"),
        (("demo", "--objects", "2", "--scene", "arm"), "'arm'"),
        (("demo", "--scene", "trajectory", "--output", "new.mcap"), "give a clip's prefix"),
        (("view", "--port", "99999999"), "expected a port"),
        (("view", "none.mcap", "--replay", "nope"), "expected one of balanced, exact, fast"),
        (("tradeoff", "none.mcap", "--scene", "fleet"), "got both"),
        (("tradeoff", "--scene", "nope"), "expected one of"),
        (("report", "none.mcap", "--replay", "nope"), "expected one of balanced, exact, fast"),
        (("report", "none.mcap", "--rules", "none.yaml"), "none.yaml"),
        (("check", "none.mcap", "--expect", "none.yaml"), "none.yaml"),
        (("import", "none", "-o", "out.mcap", "--profile", "nope"), "expected one of balanced, exact, fast"),
        (("import", "none", "-o", "out.mcap", "--map", "none.yaml"), "none.yaml"),
        (("replay", "none.mcap", "--threads", "0"), "threads: expected 1 to"),
        (("bench", "--scene", "nope"), "expected one of"),
        (("bench", "--broad-phase", "nope"), "expected one of"),
        (("bench", "--threads", "1000"), "threads: expected 1 to"),
        (("run", "--params", "none.yaml"), "--params"),
        (("run", "--on-event"), "expected --record"),
        (("sources", "--check", "none.yaml"), "none.yaml"),
        (("replay", ""), "expected a value after `replay`, got an empty text; is a variable not set?"),
        (("compare", "none.mcap", "--profile", ""), "expected a value after `--profile`"),
        (("import", "none", "-o", "out.mcap", "--profile="), "expected a value after `--profile=`"),
        (("report", "none.mcap", "--rules", "/dev/null"), "/dev/null: expected a YAML file, got a device"),
        (("check", "none.mcap", "--expect", "/dev/null", "--rules", "/dev/null"), "expect"),
        (("import", "none", "-o", "out.mcap", "--rules", "/dev/null"), "/dev/null: expected a YAML file, got a device"),
        (("run", "--rules", "/dev/null"), "/dev/null: expected a YAML file, got a device"),
        (("tradeoff", "none.mcap", "--objects", "10"), "--objects: a session is measured as it was recorded; leave it"),
        (("tradeoff", "none.mcap", "--seconds", "1"), "--seconds: a session is measured as it was recorded"),
        (("tradeoff", "none.mcap", "--seed", "1"), "--seed: a session is measured as it was recorded"),
        (("tradeoff", "none.mcap", "--path", "x"), "--path: a session is measured as it was recorded"),
        (("tradeoff", "none.mcap", "--noise", "0"), "--noise: a session is measured as it was recorded"),
        (("tradeoff", "--scene", "fleet", "--path", "x"), "path: expected the scene 'trajectory', which plays"),
        (("world", "fleet", "--path", "x"), "path: expected the scene 'trajectory', which plays"),
        (("demo", "--path", "x"), "path: expected the scene 'trajectory', which plays"),
        (("replay", "none.mcap", "--address", "x:1"), "--address: expected --engine ray"),
        (("check", "none.mcap", "--expect", "none.yaml", "--address", "x:1"), "--address: expected --engine ray"),
        (("replay", "none.mcap", "--engine", "ray", "--cut", "x"), "--cut: expected a replay in this process"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_wrong_usage_is_exit_code_2_in_one_line(
    arguments: tuple[str, ...],
    words: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("collision-monitor: error: ") and error.count("\n") == 1 and words in error
    assert not list(tmp_path.iterdir())


def test_ray_is_used_for_one_session_too(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def on_ray(function: Any, paths: list[Path], failed: Any, engine: many.Engine) -> Iterator[Any]:
        assert (engine.name, engine.address) == ("ray", "here:1")
        yield from (failed(path, "was on Ray") for path in paths)

    monkeypatch.setattr(many, "_on_ray", on_ray)
    assert main(["replay", str(GOLDEN), "--engine", "ray", "--address", "here:1"]) == 1
    assert "was on Ray" in capsys.readouterr().out


def test_the_example_is_for_the_monitor() -> None:
    check_parameter_file(EXAMPLE)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: [1", "expected YAML"),
        ("", "there are none"),
        ("horizon: 1.0", "there are none"),
        ("/other_node:\n  ros__parameters:\n    horizon: 1.0\n", "there are settings for /other_node"),
    ],
    ids=["broken", "empty", "no node", "another node"],
)
def test_parameter_files_for_nobody(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        check_parameter_file(path)


def test_the_wildcard_reaches_the_monitor(tmp_path: Path) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text("/**:\n  ros__parameters:\n    horizon: 1.0\n")
    check_parameter_file(path)


def test_equal_times_may_have_to_be_the_same() -> None:
    assert main(["compare", str(GOLDEN), str(GOLDEN), "--tolerance", "0"]) == 0
