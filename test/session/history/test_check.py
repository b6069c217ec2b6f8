"""Sessions as regression tests: expectations that hold, fail or cannot be known, and broken files."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from session_scene import NODE, TYPES

from collision_monitor import Sphere, records
from collision_monitor.cli.check import EXAMPLE
from collision_monitor.cli.main import main
from collision_monitor.codec import encode_descriptions, encode_states
from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.session import Recorder, Session
from collision_monitor.session.history.check import Checked, check_sessions, junit_xml
from collision_monitor.session.history.expectations import (
    ExpectationResult,
    evaluate_expectations,
    parse_expectations,
    read_expectations,
)
from collision_monitor.session.history.history import History
from collision_monitor.session.history.read_history import read_history
from collision_monitor.session.many_sessions import Engine, find_sessions

PROGRAM = Path(sys.executable).with_name("collision-monitor")
SHAPES, STATES, CONTACTS, PREDICTIONS, STATUS = TYPES
STEP = 20_000_000


def record_yard(path: Path, *, unseen: bool = False, close: bool = True) -> Path:
    """Record a cart that drives at 1 m/s from -3 m through a person of 0.25 m at the origin.

    They touch from 2.25 s to 3.75 s.
    """
    pipeline = Pipeline("exact")
    recorder = Recorder(path, TYPES, pipeline.metadata(node=NODE))
    names = ["cart", "person_1", "person_2"] + ["ghost"] * unseen
    shapes = encode_descriptions(
        0, "world", [ObjectDescription(k, Sphere(0.5 if k == 1 else 0.25), name=n) for k, n in enumerate(names, 1)]
    )
    pipeline.on_shapes(shapes)
    recorder.write(SHAPES, shapes, 0, 0)
    states = np.zeros(3, records.STATE)
    states["id"] = (1, 2, 3)
    states["quaternion"][:, 3] = 1.0
    states["position"][2] = (0, 50, 0)
    states["linear"][0] = (1, 0, 0)
    for k in range(300):
        stamp = 5_000_000_000 + k * STEP
        states["position"][0, 0] = -3.0 + k * STEP * 1e-9
        data = encode_states(stamp, "world", k + 1, states)
        outputs = pipeline.on_states(data)
        recorder.write(STATES, data, stamp, stamp)
        recorder.write(CONTACTS, outputs.contacts, stamp, stamp)
        recorder.write(PREDICTIONS, outputs.predictions, stamp, stamp)
        if k % 50 == 49:
            recorder.write(STATUS, pipeline.status(step_duration=0.001 + 1e-5 * k), stamp, stamp)
    recorder.close()
    if not close:
        data = path.read_bytes()
        path.write_bytes(data[: data.rindex(b"\x0f\x04\0\0\0\0\0\0\0") + 5])  # inside the data-end record
    return path


@pytest.fixture(scope="module")
def yard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_yard(tmp_path_factory.mktemp("yard") / "yard.mcap")


def outcome(history: History, text: str, replay=lambda: "identical"):
    (result,) = evaluate_expectations(parse_expectations({"expect": [yaml.safe_load(text)]}), history, replay)
    return result


def test_the_history_is_what_happened(yard: Path) -> None:
    history = read_history(Session(yard))
    (collision,) = history.collisions
    assert collision.pair == (1, 2)
    assert collision.begin == pytest.approx(2.26, abs=0.021)
    assert collision.end == pytest.approx(3.76, abs=0.021)
    assert collision.deepest == pytest.approx(-0.75, abs=0.01)
    assert collision.warned == pytest.approx(2.0, abs=0.05)  # the horizon
    assert collision.certain
    assert history.duration == pytest.approx(299 * 0.02)
    assert len(history.durations) == 6
    assert history.problems == []
    # the same from the answers of a replay
    again = read_history(Session(yard), Session(yard).profile)
    assert again.collisions == history.collisions
    assert again.replayed and len(again.durations) == 300


@pytest.mark.parametrize(
    ("text", "holds", "found"),
    [
        ("{contact: [cart, person_1], between: [2.2, 2.3]}", True, "first contact at 2.26"),
        ("{contact: [person_1, cart]}", True, "first contact"),
        ("{contact: ['person_*', cart], between: [2.4, 9]}", False, "first contact at 2.26"),
        ("{contact: [cart, person_2]}", False, "no contact"),
        ("{no_contact: [cart, person_2]}", True, "no contact"),
        ("{no_contact: any}", False, "contact at 2.26"),
        ("{no_prediction: [cart, person_2], under: 0.5}", True, "no such prediction"),
        ("{no_prediction: any, under: 0.5}", False, "cart and person_1"),
        ("{warned: any, before: 1.9}", True, "1 contacts"),
        ("{warned: any, before: 2.5}", False, "predicted only 2.0"),
        ("{step_time_p99: 0.01}", True, "0.00"),
        ("{step_time_p99: 0.001}", False, "over 6 steps that a status reported"),
        ("{replay: identical}", True, "identical"),
        ("{complete: true}", True, "nothing is missing"),
        ("{no_contact: [cart, cat]}", False, "one of cart, person_1, person_2; got 'cat'"),
        ("{contact: [1, 'person_*']}", True, "first contact at 2.26"),
        ("{no_contact: [1, 77]}", False, "name or id of an object of the session"),
    ],
)
def test_expectations(yard: Path, text: str, holds: bool, found: str) -> None:
    result = outcome(read_history(Session(yard)), text)
    assert result.holds is holds
    assert found in result.found


def test_what_nobody_can_know_does_not_hold(tmp_path: Path) -> None:
    ghost = read_history(Session(record_yard(tmp_path / "ghost.mcap", unseen=True)))
    assert outcome(ghost, "{no_contact: [cart, ghost]}").found == "not known: no state of ghost"
    cut = read_history(Session(record_yard(tmp_path / "cut.mcap", close=False)))
    for text in ("{no_contact: [cart, person_2]}", "{no_prediction: [cart, person_2]}", "{complete: true}"):
        result = outcome(cut, text)
        assert not result.holds
        assert "cut off" in result.found
    assert not outcome(cut, "{replay: identical}", lambda: "diverged: step 7").holds


def test_the_example_of_the_help_is_one() -> None:
    assert len(parse_expectations(yaml.safe_load(EXAMPLE))) == 9


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "expected a list under the one key `expect`"),
        ({"expect": []}, "at least one expectation"),
        ({"expect": ["contact"]}, "expectation 1: expected one of contact, no_contact"),
        ({"expect": [{"contact": ["a"]}]}, "expected two names or ids, .* or any"),
        ({"expect": [{"contact": ["a", "b"], "under": 1}]}, "expected only contact, between, got under"),
        ({"expect": [{"contact": ["a", "b"], "between": [3, 2]}]}, "does not end before it begins"),
        ({"expect": [{"warned": "any"}]}, "expected a number of seconds"),
        ({"expect": [{"replay": True}]}, "expected identical"),
        ({"expect": [{"complete": False}]}, "expected true"),
    ],
)
def test_bad_expectations_are_reported(content: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        parse_expectations(content)


def test_many_sessions_on_many_processes(yard: Path, tmp_path: Path) -> None:
    folder = tmp_path / "sessions"
    folder.mkdir()
    for k in range(3):
        (folder / f"{k}.mcap").write_bytes(yard.read_bytes())
    (folder / "1.mcap").write_bytes(b"no session")
    expect = tmp_path / "expect.yaml"
    expect.write_text("expect:\n  - contact: [cart, person_1]\n  - no_contact: any\n")
    paths = find_sessions([str(folder)])
    assert [p.name for p in paths] == ["0.mcap", "1.mcap", "2.mcap"]
    expected = read_expectations(expect)
    one = list(check_sessions(paths, expected, engine=Engine(jobs=1)))
    assert list(check_sessions(paths, expected, engine=Engine(jobs=2))) == one
    assert "expected an MCAP file" in one[1].error
    assert [o.holds for o in one[0].outcomes] == [True, False] == [o.holds for o in one[2].outcomes]
    suites = ElementTree.fromstring(junit_xml(one))
    counts = [(s.get("tests"), s.get("failures"), s.get("errors")) for s in suites]
    assert float(suites.get("time")) > 0.0
    assert all(float(case.get("time")) >= 0.0 for case in suites.iter("testcase") if case.find("error") is None)
    assert counts == [("2", "1", "0"), ("1", "0", "1"), ("2", "1", "0")]
    with pytest.raises(InputError, match="got none"):
        find_sessions([str(tmp_path / "sessions" / ".."), str(_empty(tmp_path))])


def _empty(tmp_path: Path) -> Path:
    (tmp_path / "empty").mkdir()
    return tmp_path / "empty"


def test_the_command_and_its_exit_codes(yard: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    expect = tmp_path / "expect.yaml"

    def run(text: str, *arguments: str) -> tuple[int, str, str]:
        expect.write_text(text)
        code = main(["check", *arguments, "--expect", str(expect)])
        return code, *capsys.readouterr()

    code, out, _ = run("expect: [{contact: [cart, person_1]}, {replay: identical}]", str(yard))
    assert code == 0
    assert "1 sessions: 1 hold, 0 fail" in out
    rules = Path(__file__).parents[3] / "config" / "rules.yaml"
    assert run("expect: [{contact: [cart, person_1]}]", str(yard), "--rules", str(rules))[0] == 0
    report = tmp_path / "junit.xml"
    code, out, _ = run("expect: [{no_contact: any}]", str(yard), "--replay", "fast", "--json", "--junit", str(report))
    assert code == 3
    assert json.loads(out)["sessions"][0]["outcomes"][0]["holds"] is False
    assert ElementTree.parse(report).getroot()[0].get("failures") == "1"
    assert run("expect: [{contact: [cart, person_1]}]", str(yard), str(tmp_path / "none.mcap"))[0] == 1
    for text, words in (
        ("expect: [{touch: any}]", "expected one of contact"),
        ("expect: [{no_contact: any, no_contact: [cart, cat]}]", "the same key twice"),
        ("expect: " + "[" * 2000, "expected YAML"),
    ):
        code, _, error = run(text, str(yard))
        assert code == 2
        assert error.count("\n") == 1 and words in error
    code, _, error = run("expect: [{no_contact: any}]", str(yard), "--junit", str(tmp_path / "nowhere" / "junit.xml"))
    assert code == 1
    assert "expected a file that can be written" in error


def test_the_example_of_the_docs_is_what_it_prints(yard: Path, tmp_path: Path) -> None:
    page = (Path(__file__).parents[3] / "docs" / "check.md").read_text()
    (expectations,) = re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
    (printed,) = re.findall(r"echo \$\?\n(.*?)3\n```", page, re.DOTALL)
    (tmp_path / "yard.mcap").write_bytes(yard.read_bytes())
    (tmp_path / "expectations.yaml").write_text(expectations)
    command = [PROGRAM, "check", "yard.mcap", "--expect", "expectations.yaml"]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert answer.stdout == printed
    assert answer.returncode == 3


def test_objects_of_one_name_are_all_meant(yard: Path) -> None:
    """A name that an object had before counts too."""
    history = read_history(Session(yard))
    history.names = {"cart": {1}, "person": {2, 3}, "visitor": {3}}
    assert not outcome(history, "{no_contact: [cart, person]}").holds
    assert outcome(history, "{no_contact: [cart, visitor]}").holds


def test_junit_is_xml_whatever_the_names_are() -> None:
    text = junit_xml([Checked("a\x00.mcap", [ExpectationResult("no_contact: \x1b[1m", False, "\ud800 <&")])])
    (case,) = ElementTree.fromstring(text)[0]
    assert case.get("name") == "no_contact: \ufffd[1m"


def test_the_pytest_plugin(yard: Path, tmp_path: Path) -> None:
    (tmp_path / "yard.mcap").write_bytes(yard.read_bytes())
    (tmp_path / "expect.yaml").write_text("expect: [{warned: any, before: 1.5}]")
    (tmp_path / "test_yard.py").write_text(
        """
import pytest

@pytest.mark.session("yard.mcap")
def test_yard(session):
    assert len(session.contacts("cart", "person_*")) == 1
    first = session.predictions("person_1", "cart")[0]
    assert first.time + first.lower < 2.26 < first.time + first.upper + 0.02
    assert session.predictions("cart", 3) == []
    session.check("expect.yaml")
    assert session.replay() == "identical"

@pytest.mark.session("yard.mcap", replay="fast")
def test_fails_as_it_should(session):
    session.check({"expect": [{"no_contact": "any"}]})

def test_without_a_marker(session):
    pass

@pytest.mark.session("yard.mcap", replay="slow")
def test_with_a_profile_that_is_none(session):
    pass
"""
    )
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--strict-markers", str(tmp_path)]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=tmp_path)
    assert "1 failed, 1 passed, 2 errors" in answer.stdout, answer.stdout
    assert "no_contact: any: contact at 2.2" in answer.stdout
    assert "expected a marker such as" in answer.stdout
    assert "one of balanced, exact, fast" in answer.stdout
    assert "history.py" not in answer.stdout  # no traceback of the plugin for a user's mistake
