"""Hostile YAML at every door: one line with the file and what is wrong, an exit code for bad input, soon."""

from __future__ import annotations

import math
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from processor_time import within

from collision_monitor.cli.main import main
from collision_monitor.errors import InputError, SessionError
from collision_monitor.session import Session
from collision_monitor.settings.profile import Profile
from collision_monitor.settings.yaml_entry import YamlEntry
from collision_monitor.settings.yaml_file import DEEPEST, LARGEST, NODES, read_yaml
from collision_monitor.sources.bag import Bag
from collision_monitor.sources.ground.yaml_table import number, pose

SECONDS = 2.0
"""Processor time to refuse a file."""

BOMB = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{name}: &{name} [{','.join([f'*{last}'] * 9)}]\n" for last, name in zip("abcdefghi", "bcdefghij", strict=True)
)

HOSTILE: dict[str, tuple[bytes, str]] = {
    "anchor bomb": (BOMB.encode(), "line 2: expected YAML, got: the alias *a"),
    "recursion": (b"a: &a [*a]", "the alias *a"),
    "merge of an alias": (b"a: &a {x: 1}\nb: {<<: *a}", "line 2: expected YAML, got: the alias *a"),
    "flow lists": (b"[" * 100_000, "deeper nesting"),
    "flow tables": (b"{a: " * 100_000, "deeper nesting"),
    "block lists": (b"- " * 100_000, "deeper nesting"),
    "block tables": (b"".join(b" " * k + b"a:\n" for k in range(1000)), f"line {DEEPEST + 1}"),
    "keys of keys": (b"? " * 100_000, "deeper nesting"),
    "10 MB": (b"a" * 10_000_000, f"at most {LARGEST} bytes"),
    "many values": (b"[" + b"1," * (LARGEST // 2 - 2) + b"]", "more values (at most "),
    "binary": (bytes(range(256)) * 100, "UTF-8"),
    "UTF-16": ("a: 1".encode("utf-16"), "UTF-8"),
    "NUL": (b"a: \0", "expected YAML"),
    "a tag of Python": (b"!!python/object/apply:os.system [true]", "line 1: expected YAML, got: could not determine"),
    "a tag that does not fit": (b"a: !!bool x", "expected YAML"),
    "a wrong date": (b"a: 2024-99-99", "put a text in quotes"),
    "a long number": (b"a: " + b"1" * 500_000, "a longer number"),
    "a number of base 60": (b"a: 1" + b":1" * 500_000, "a longer number"),
    "a duplicate key": (b"expect: 1\nexpect: 2", "line 2: expected YAML, got: the same key twice: 'expect'"),
    "two documents": (b"a: 1\n---\nb: 2", "expected YAML"),
    "anchors": (b"".join(b"- &a%d x\n" % k for k in range(80_000)), ""),
    "long text": (b"a: " + b"x" * (LARGEST - 3), ""),
    "long key": (b"? " + b"x" * (LARGEST - 10) + b"\n: 1", ""),
}

DOORS = {
    "check --expect": (["check", "SESSION", "--expect", "FILE"], 2),
    "import --map": (["import", "SESSION", "--map", "FILE", "-o", "OUT"], 2),
    "import --profile": (["import", "SESSION", "--profile", "FILE", "-o", "OUT"], 2),
    "run --params": (["run", "--params", "FILE"], 2),
}


@pytest.mark.parametrize("door", DOORS)
def test_hostile_yaml_is_refused_in_one_line(
    door: str, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments, code = DOORS[door]
    file, out = tmp_path / "hostile.yaml", tmp_path / "out.mcap"
    names = {"SESSION": str(recorded), "FILE": str(file), "OUT": str(out)}
    file.write_text("none: of these")
    assert main([names.get(each, each) for each in arguments]) == code  # imports what this command needs
    capsys.readouterr()
    for name, (data, words) in HOSTILE.items():
        file.write_bytes(data)
        with within(SECONDS, name):
            assert main([names.get(each, each) for each in arguments]) == code, name
        error = capsys.readouterr().err
        assert error.startswith("collision-monitor: error: ") and error.count("\n") == 1, name
        assert str(file) in error and words in error and len(error) < 3000, (name, error)
        assert not out.exists()


@pytest.mark.parametrize(("door", "name"), [*zip(DOORS, ["anchor bomb", "flow lists"] * 2, strict=True)])
def test_the_real_command(door: str, name: str, recorded: Path, tmp_path: Path) -> None:
    """An anchor bomb or deep nesting, in a process of its own."""
    arguments, code = DOORS[door]
    file = tmp_path / "hostile.yaml"
    file.write_bytes(HOSTILE[name][0])
    names = {"SESSION": str(recorded), "FILE": str(file), "OUT": str(tmp_path / "out.mcap")}
    command = [sys.executable, "-m", "collision_monitor", *(names.get(each, each) for each in arguments)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    answer = subprocess.run(command, capture_output=True, text=True, timeout=120, env=os.environ)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert answer.returncode == code, answer.stderr
    assert "Traceback" not in answer.stderr and str(file) in answer.stderr
    assert after.ru_utime - before.ru_utime < SECONDS + 8, "with the start of the program"


def test_what_is_no_attack_is_read(tmp_path: Path) -> None:
    file = tmp_path / "good.yaml"
    file.write_bytes("\ufeffa: 1\r\nb: [2.5, text]\r\nc: {<<: {d: yes}, e: 1:30}\r\n".encode())
    assert read_yaml(file) == {"a": 1, "b": [2.5, "text"], "c": {"d": True, "e": 90}}
    file.write_text("[" * (DEEPEST - 1) + "]" * (DEEPEST - 1))
    read_yaml(file)
    shared = {"depth": 1}
    file.write_text(yaml.safe_dump([shared] * 100))
    assert read_yaml(file, aliases=True) == [shared] * 100
    with pytest.raises(InputError, match="the alias"):
        read_yaml(file)


def test_aliases_count_for_what_they_stand_for(tmp_path: Path) -> None:
    file = tmp_path / "bomb.yaml"
    file.write_text(BOMB)
    with pytest.raises(InputError, match=f"more values .at most {NODES}"):
        read_yaml(file, aliases=True)
    file.write_text("a: &a [1, *a]")
    with pytest.raises(InputError, match="itself"):
        read_yaml(file, aliases=True)


def test_the_metadata_of_a_bag(recorded: Path, tmp_path: Path) -> None:
    """A session does without it; a bag of another program needs it."""
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "bag_0.mcap").write_bytes(recorded.read_bytes())
    for name in ("anchor bomb", "recursion", "flow lists", "10 MB", "binary", "many values"):
        (folder / "metadata.yaml").write_bytes(HOSTILE[name][0])
        with within(SECONDS, name):
            assert len(list(Session(folder).messages())) > 50
            with pytest.raises(SessionError, match=r"metadata\.yaml"):
                Bag(folder)


def test_all_yaml_goes_through_the_one_loader() -> None:
    package = Path(__file__).parents[2] / "collision_monitor"
    loaders = [
        path.name for path in package.rglob("*.py") if "yaml.load" in (text := path.read_text()) or "safe_load" in text
    ]
    assert loaders == ["yaml_file.py"]


@pytest.mark.parametrize("value", [10**400, -(10**400), math.inf, math.nan, True, "1"], ids=lambda x: f"{x!r:.5}")
def test_numbers_that_no_float_holds_are_refused(value: object) -> None:
    with pytest.raises(InputError, match="a number of metres"):
        number(value, "padding", "metres")
    with pytest.raises(InputError, match="a number of metres"):
        YamlEntry(value, "rules.yaml", {}, ("distance",)).number("metres")
    with pytest.raises(InputError, match="expected"):
        Profile.from_dict({"horizon": value})
    with pytest.raises(InputError, match="pose: expected"):
        pose([value, 0.0], "pose")
