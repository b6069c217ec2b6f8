"""Every path that a command or a running node opens, leading to no regular file: refused at once, in one line."""

from __future__ import annotations

import ast
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from no_files import NO_FILES, sparse
from processor_time import within

from collision_monitor.alerts.rules import LARGEST, MOST_PATTERNS, Rules
from collision_monitor.cli.main import main
from collision_monitor.errors import CollisionMonitorError, InputError
from collision_monitor.robots.mesh_location import FileLocator
from collision_monitor.robots.robot import Description
from collision_monitor.session import Session
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.mesh_file import load_mesh
from collision_monitor.sources.bag import Bag
from collision_monitor.sources.ground.mapping import load_mapping

PACKAGE = Path(__file__).parents[2] / "collision_monitor"

WAIT = 60
"""s of the clock after which a command counts as hanging."""

DOORS: dict[str, tuple[list[str], str]] = {
    "replay": (["replay", "PATH"], ".mcap"),
    "report": (["report", "PATH", "-o", "OUT"], ".mcap"),
    "compare": (["compare", "SESSION", "PATH"], ".mcap"),
    "check": (["check", "PATH", "--expect", "EXPECT"], ".mcap"),
    "salvage": (["salvage", "PATH", "-o", "OUT"], ".mcap"),
    "view": (["view", "PATH", "--port", "0"], ".mcap"),
    "tradeoff": (["tradeoff", "PATH"], ".mcap"),
    "tune": (["tune", "PATH"], ".mcap"),
    "import MCAP": (["import", "PATH", "-o", "OUT"], ".mcap"),
    "import db3": (["import", "PATH", "-o", "OUT"], ".db3"),
    "import bag": (["import", "PATH", "-o", "OUT"], ".bag"),
    "import --map": (["import", "SESSION", "--map", "PATH", "-o", "OUT"], ".yaml"),
    "import --rules": (["import", "SESSION", "--rules", "PATH", "-o", "OUT"], ".yaml"),
    "check --expect": (["check", "SESSION", "--expect", "PATH"], ".yaml"),
    "report --rules": (["report", "SESSION", "--rules", "PATH", "-o", "OUT"], ".yaml"),
    "report --replay": (["report", "SESSION", "--replay", "PATH", "-o", "OUT"], ".yaml"),
    "run --params": (["run", "--params", "PATH"], ".yaml"),
    "run --rules": (["run", "--rules", "PATH"], ".yaml"),
    "run --sources": (["run", "--sources", "PATH"], ".yaml"),
    "sources --check": (["sources", "--check", "PATH"], ".yaml"),
    "bench --scene-file": (["bench", "--scene-file", "PATH"], ".npz"),
    "world --path": (["world", "trajectory", "--path", "PATH"], "_ped.csv"),
}

RESULTS: dict[str, list[str]] = {
    "report": ["report", "SESSION", "-o", "PATH"],
    "salvage": ["salvage", "SESSION", "-o", "PATH"],
    "import": ["import", "SESSION", "-o", "PATH"],
    "check --junit": ["check", "SESSION", "--expect", "EXPECT", "--junit", "PATH"],
    "replay --cut": ["replay", "SESSION", "--cut", "PATH"],
    "tune": ["tune", "SESSION", "-o", "PATH"],
    "tradeoff --csv": ["tradeoff", "SESSION", "--csv", "PATH"],
    "tradeoff --png": ["tradeoff", "SESSION", "--png", "PATH"],
}

READERS = {
    "rules": (lambda path: Rules.given(str(path)), ".yaml"),
    "profile": (lambda path: Profile.named(str(path)), ".yaml"),
    "sources": (load_mapping, ".yaml"),
    "robot description": (Description.read, ".urdf"),
    "mesh": (load_mesh, ".stl"),
    "mesh of a robot": (lambda path: FileLocator(Path()).find(str(path)), ".stl"),
    "session": (Session, ".mcap"),
    "bag": (Bag, ".bag"),
}
"""What opens a path, some of them in a running node."""


@contextmanager
def without_waiting() -> Iterator[None]:
    def fail(*_: object) -> None:
        raise AssertionError(f"still waiting after {WAIT} s")

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(WAIT)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("door", DOORS)
def test_a_command_names_what_it_found_in_place_of_a_file(
    door: str, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments, suffix = DOORS[door]
    monkeypatch.chdir(tmp_path)  # where a command without an output would write
    (tmp_path / "expect.yaml").write_text("expect: [{replay: identical}]\n")
    names = {"SESSION": str(recorded), "OUT": str(tmp_path / "out.mcap"), "EXPECT": str(tmp_path / "expect.yaml")}
    for number, (kind, (make, text)) in enumerate(NO_FILES.items()):
        path = make(tmp_path / f"{number}{suffix}")
        capsys.readouterr()
        with without_waiting():
            assert main([str(path) if each == "PATH" else names.get(each, each) for each in arguments]) in (1, 2), kind
        said = capsys.readouterr()
        error = said.err if door != "check" else said.out  # it reads several sessions and goes on
        if door != "check":
            assert error.startswith("collision-monitor: error: ") and error.count("\n") == 1, (kind, error)
        if (kind == "folder" and suffix in (".mcap", ".db3", ".bag")) or (kind == "missing" and suffix == "_ped.csv"):
            continue  # a folder may be that of a session or a bag, and a name the prefix of several files
        assert text in error, (kind, error)
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.parametrize("result", RESULTS)
def test_a_result_goes_into_no_pipe_that_nobody_may_read(
    result: str, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "expect.yaml").write_text("expect: [{replay: identical}]\n")
    path = NO_FILES["pipe"][0](tmp_path / "out.png")
    (tmp_path / "link.png").symlink_to(path)
    names = {"SESSION": str(recorded), "EXPECT": str(tmp_path / "expect.yaml")}
    for target in (path, tmp_path / "link.png"):
        names["PATH"] = str(target)
        arguments = [names.get(each, each) for each in RESULTS[result]]
        with without_waiting():
            assert main([*arguments, *(["--force"] if result != "import" else [])]) in (1, 2)
        assert "got a named pipe" in capsys.readouterr().err


@pytest.mark.parametrize("reader", READERS)
def test_a_reader_names_what_it_found_in_place_of_a_file(reader: str, tmp_path: Path) -> None:
    read, suffix = READERS[reader]
    for number, (kind, (make, text)) in enumerate(NO_FILES.items()):
        if reader == "mesh of a robot" and kind == "LFS pointer":
            continue  # it finds a file and opens none
        path = make(tmp_path / f"{number}{suffix}")
        with without_waiting(), pytest.raises(CollisionMonitorError) as caught:
            read(path)
        if kind != "folder" or suffix not in (".mcap", ".bag"):
            assert text in str(caught.value), kind


@pytest.mark.parametrize("reader", ["rules", "profile", "sources", "robot description", "mesh"])
def test_a_file_without_end_is_refused_by_its_size(reader: str, tmp_path: Path) -> None:
    read, suffix = READERS[reader]
    path = sparse(tmp_path / f"terabyte{suffix}")
    with within(1.0, reader), pytest.raises(CollisionMonitorError, match=r"of at most \d+ bytes, got 1099511627776"):
        read(path)


ONE_RULE = "rules: {near: {between: [any, any], caution: {distance: 1}}}\n"

COSTLY = {
    "0.84 MB": ("# " + "x" * 840_000 + "\n" + ONE_RULE, f"at most {LARGEST} bytes"),
    "many classes": (
        "classes:\n" + "".join(f"  c{c}: [{','.join('abcd')}]\n" for c in range(401)) + ONE_RULE,
        "at most 100, got 401",
    ),
    "members of all classes": (
        "classes:\n" + "".join(f"  c{c}: [{','.join(f'n{k}' for k in range(25))}]\n" for c in range(50)) + ONE_RULE,
        f"at most {MOST_PATTERNS} members",
    ),
    "wildcards": (
        "classes:\n" + "".join(f"  c{c}: ['{'*a' * 100}']\n" for c in range(50)) + ONE_RULE,
        "members of all classes with 2000 of * ? [ together",
    ),
    "a long member": ("classes: {c: ['" + "*a" * 30_000 + "']}\n" + ONE_RULE, "at most 256 characters, got 60000"),
    "many values": ("[" + "1," * 30_000 + "]", "at most 5000"),
}


@pytest.mark.parametrize("kind", COSTLY)
def test_rules_that_would_silence_a_running_monitor_are_refused_soon(kind: str, tmp_path: Path) -> None:
    text, reason = COSTLY[kind]
    path = tmp_path / "rules.yaml"
    path.write_text(text)
    for value in (str(path), f"{text}\n"):
        with within(0.5, kind), pytest.raises(InputError) as caught:
            Rules.given(value)
        assert reason in str(caught.value) or "of at most" in str(caught.value)


def test_the_largest_rules_are_read_soon() -> None:
    """As many of everything as there may be. They took 60 ms on the machine of the first measurement."""
    many = "".join(
        f"  r{k}: {{between: [c{k % 10}, any], caution: {{distance: 2, time_to_collision: 2}}, "
        f"warning: {{distance: 1}}, critical: {{distance: 0.1}}}}\n" for k in range(100)
    )  # fmt: skip
    text = "classes:\n" + "".join(f"  c{c}: [{', '.join(f'n{c}_{k}_*' for k in range(100))}]\n" for c in range(10))
    with within(1.0):
        assert len(Rules.parse(f"{text}rules:\n{many}").rules) == 100


OPENERS = {
    "settings/regular_file.py": "the one opener",
    "session/recording/session_file.py": "writes",
    "session/mcap/salvage.py": "writes",
    "sources/bag.py": "writes a copy that is unpacked",
    "session/mcap/definitions.py": "reads a file of this package",
    "session/history/growing_rows.py": "reads /proc/meminfo",
    "monitor/state/snapshot.py": "reads an entry of an archive in memory",
    "pipeline/provenance.py": "reads the files of this package",
    "cli/tradeoff.py": "writes",
    "cli/demo.py": "writes",
    "cli/output/output_streams.py": "writes",
    "_jit/cache.py": "reads the files of this package",
    "_jit/imports.py": "reads the files of this package",
    "_jit/places.py": "reads the cache of compiled kernels",
}


def test_all_files_of_others_are_opened_by_the_one_opener() -> None:
    found = set()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call):
                name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
                if name in ("open", "read_bytes", "fromfile", "loadtxt", "genfromtxt") or (
                    name == "read_text" and not node.args and isinstance(node.func, ast.Attribute)
                ):
                    found.add(str(path.relative_to(PACKAGE)))
    assert found == set(OPENERS)
