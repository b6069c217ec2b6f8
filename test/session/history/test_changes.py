"""The changes that `compare` reports, between sessions with known changes and between two profiles."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from played_session import NASTY, START, played, record_drive, record_scene, record_states

from collision_monitor.cli.main import main
from collision_monitor.session import Session
from collision_monitor.session.history.changes import changes
from collision_monitor.session.history.read_history import read_history
from collision_monitor.world import make_scene

STEP = 0.02


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return sessions: a drive, the same again, a slower one, one that ends before the contact, and one cut off."""
    path = tmp_path_factory.mktemp("changes")
    for name in ("a", "same"):
        record_drive(path / f"{name}.mcap", 2.0)
    record_drive(path / "slower.mcap", 2.0, speed=0.9)
    record_drive(path / "short.mcap", 1.0)
    data = (path / "a.mcap").read_bytes()
    (path / "cut.mcap").write_bytes(data[: data.rindex(b"\x0f\x04\0\0\0\0\0\0\0") + 5])
    return path


def test_equal_sessions_are_the_same(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(folder / "a.mcap"), str(folder / "same.mcap")]) == 0
    assert capsys.readouterr().out.endswith("\nthe same\n")


def test_a_collision_that_was_shifted(folder: Path) -> None:
    a, b = (read_history(Session(folder / f"{name}.mcap")) for name in ("a", "slower"))
    found = changes(a, b)
    assert found.known and found.by_stamps
    change = found.changes[0]
    assert change.event.what == "collision" and set(change.event.pair) == {NASTY, "post"}
    assert {"begin", "warned"} <= set(change.fields)
    assert change.b.begin - change.a.begin == pytest.approx(1.5 / 0.9 - 1.5, abs=STEP)
    assert changes(a, b, tolerance=0.3).changes == [each for each in found.changes if each.fields == ()]
    mirrored = changes(b, a)
    assert [(each.b, each.a) for each in mirrored.changes] == [(each.a, each.b) for each in found.changes]


def test_what_only_one_has(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(folder / "a.mcap"), str(folder / "short.mcap"), "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert not found["same"] and found["known"]
    (collision,) = (each for each in found["changes"] if (each["a"] or each["b"])["what"] == "collision")
    assert collision["b"] is None and set(collision["a"]["pair"]) == {NASTY, "post"}
    assert collision["a"]["begin"] == pytest.approx(1.5, abs=1.5 * STEP)
    (warning,) = (each for each in found["changes"] if each["a"] is None)
    assert warning["b"]["what"] == "warning" and warning["b"]["end"] is None  # open, because the session ends
    assert (found["a"]["collisions"], found["b"]["collisions"]) == (1, 0)
    assert main(["compare", str(folder / "short.mcap"), str(folder / "a.mcap"), "--limit", "1"]) == 3
    text = capsys.readouterr().out
    assert "collision  only in B" in text and "more (--limit, --json)" in text
    assert text.splitlines()[-1].startswith("different: 1 collision only in B")


def test_what_is_missing_is_never_the_same(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", str(folder / "cut.mcap"), str(folder / "cut.mcap")]) == 4
    text = capsys.readouterr().out
    assert "missing in A: the recording was cut off" in text
    assert text.endswith("no difference was found, but not all is known\n")


def test_two_profiles_on_one_session(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = str(folder / "a.mcap")
    assert main(["compare", session, "--profile", "exact", "--replay"]) == 0
    assert main(["compare", session, "--profile", "exact", "--profile", "exact"]) == 0
    capsys.readouterr()
    scene = record_scene(folder / "crossing.mcap", "crossing", 4.0)
    coarse = folder / "coarse.yaml"
    coarse.write_text("based_on: fast\nadaptive_tolerances: false\n")
    assert main(["compare", str(scene), "--profile", str(coarse), "--profile", "exact", "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert (found["a"]["profile"], found["b"]["profile"]) == ("coarse", "exact")
    assert found["a"]["replayed"] and found["b"]["replayed"]
    assert found["a"]["step_median"] > 0.0
    # both find every collision in the same step; the coarse profile warns earlier, because it allows for more error
    collisions = [each for each in found["changes"] if (each["a"] or each["b"])["what"] == "collision"]
    assert collisions
    for each in collisions:
        assert each["fields"] == ["warned"] and each["a"]["warned"] > each["b"]["warned"]


def test_sessions_of_other_times_are_compared_from_their_starts(folder: Path) -> None:
    scene = make_scene("crossing")
    states = list(played(scene, 3.5))
    for name, start in (("today", START), ("tomorrow", START + 86_400_000_000_000)):
        record_states(folder / f"{name}.mcap", scene.descriptions, states, start=start)
    found = changes(*(read_history(Session(folder / f"{name}.mcap")) for name in ("today", "tomorrow")))
    assert not found.by_stamps
    assert found.changes == [] and found.a.collisions > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("a.mcap",), "expected two sessions, or one session and one or two --profile"),
        (("a.mcap", "same.mcap", "short.mcap"), "got 3 and 0"),
        (("a.mcap", "same.mcap", "--profile", "fast"), "got 2 and 1"),
        (("a.mcap", "none.mcap"), "nothing there"),
        (("a.mcap", "--profile", "hasty"), "expected one of"),
    ],
    ids=["one", "three", "both", "none", "profile"],
)
def test_bad_input_is_one_line(
    arguments: tuple[str, ...],
    words: str,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(folder)
    assert main(["compare", *arguments]) == (1 if "none.mcap" in arguments else 2)
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and words in error
