"""One function over many files: results in order, even if one of the files fails."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from collision_monitor.cli.main import main
from collision_monitor.errors import InputError, SessionError, UnsupportedError
from collision_monitor.session.many_sessions import ENDED, Engine, find_sessions, for_each


def work(path: Path) -> str:
    match path.name:
        case "ends":
            os._exit(9)
        case "refuses":
            raise SessionError("expected more")
        case "fails":
            raise ZeroDivisionError
    return path.name.upper()


def failed(path: Path, why: str) -> str:
    return f"{path.name}: {why}"


@pytest.fixture(autouse=True)
def importable_by_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put this module where a spawned process finds it; pytest's import mode leaves it out of `sys.path`."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    monkeypatch.setattr(work, "__module__", "test_many_sessions")
    monkeypatch.setattr(failed, "__module__", "test_many_sessions")
    monkeypatch.setitem(sys.modules, "test_many_sessions", sys.modules[__name__])


def test_one_that_breaks_does_not_stop_the_others() -> None:
    paths = [Path(name) for name in ("a", "refuses", "fails", "ends", "b", "ends", "c")]
    found = list(for_each(work, paths, failed, Engine(jobs=2)))
    assert found == [
        "A",
        "refuses: expected more",
        "fails: an error of collision_monitor itself: ZeroDivisionError()",
        f"ends: {ENDED}",
        "B",
        f"ends: {ENDED}",
        "C",
    ]


def test_the_number_of_jobs_does_not_matter() -> None:
    paths = [Path(f"file {k}") for k in range(9)]
    one = list(for_each(work, paths, failed, Engine(jobs=1)))
    assert one == [f"FILE {k}" for k in range(9)]
    assert list(for_each(work, paths, failed, Engine(jobs=3))) == one


def test_without_ray_it_is_said_what_to_install() -> None:
    if find_spec("ray") is not None:
        pytest.skip("Ray is installed")
    with pytest.raises(UnsupportedError, match=r"pip install '.\[ray\]'"):
        list(for_each(work, [Path("a")], failed, Engine("ray")))


def test_ray_gives_what_processes_give(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("ray")
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=":")
    paths = [Path(name) for name in ("a", "refuses", "fails", "ends", "b")]
    assert list(for_each(work, paths, failed, Engine("ray", jobs=2))) == list(for_each(work, paths, failed))


def test_an_address_where_no_cluster_listens_is_reported_at_once() -> None:
    pytest.importorskip("ray")
    for address, words in (("127.0.0.1:1", "expected a cluster that listens"), ("here", "expected HOST:PORT")):
        with pytest.raises(InputError, match=words):
            list(for_each(work, [Path("a")], failed, Engine("ray", address=address)))


def test_sessions_are_found_by_name_wildcard_and_folder(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    for name in ("b.mcap", "a[1].mcap", "in/c.mcap", "in/notes.txt"):
        (tmp_path / name).touch()
    names = [p.name for p in find_sessions([f"{tmp_path}/*.mcap", str(tmp_path), f"{tmp_path}/a[1].mcap"])]
    assert names == ["a[1].mcap", "b.mcap", "c.mcap"]
    assert find_sessions(["missing.mcap"]) == [Path("missing.mcap")]  # opening it reports the error
    (tmp_path / "in" / "split").mkdir()
    for part in ("split_0.mcap", "split_1.mcap"):
        (tmp_path / "in" / "split" / part).touch()
    assert [p.name for p in find_sessions([str(tmp_path / "in")])] == ["c.mcap", "split"], "a folder that is a session"
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="got none"):
        find_sessions([str(tmp_path / "empty")])


def test_replay_takes_many_sessions(recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for k in range(3):
        (tmp_path / f"{k}.mcap").write_bytes(recorded.read_bytes())
    (tmp_path / "1.mcap").write_bytes(b"no session")

    def run(*arguments: object) -> tuple[int, str]:
        return main(["replay", *map(str, arguments)]), capsys.readouterr().out

    command = [Path(sys.executable).with_name("collision-monitor"), "replay", tmp_path, "--jobs", "2"]
    two = subprocess.run(command, capture_output=True, text=True, timeout=120)
    code, one = run(tmp_path, "--jobs", 1)
    assert code == two.returncode == 1
    assert one == two.stdout
    assert [line.split(": ")[1].split(",")[0] for line in one.splitlines() if not line.startswith(" ")] == [
        "identical",
        "cannot be read",
        "identical",
    ]
    assert run(tmp_path / "0.mcap", tmp_path / "2.mcap", "--json", "--jobs", 1)[0] == 0
