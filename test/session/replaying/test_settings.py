"""A session with changed settings replays bit by bit, as a whole and in parts, and all other tools read it."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from session_scene import NODE, SETTINGS, START, STEP, record
from started_threads import StartedThreads, threads_start

from collision_monitor.cli.main import main
from collision_monitor.codec import decode_contacts, decode_parameter_event, decode_status, encode_parameter_event
from collision_monitor.errors import MessageError
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.session import Session, Splitting
from collision_monitor.session.history.read_history import AS_RECORDED, read_history
from collision_monitor.session.replaying.replay import replay
from collision_monitor.session.replaying.replay_report import Verdict
from collision_monitor.settings.profile import Profile

FAST = Profile.named("fast").replace(horizon=1.0, contact_margin=0.01, contact_points=4, model_primitive="kdop14")
SWITCHES = {20: FAST, 35: Profile.named("exact").replace(threads=2, contact_points=2)}


@pytest.fixture(scope="module")
def switched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("switched") / "run.mcap"
    with threads_start() as started:
        record(path, switches=SWITCHES)
    assert started.most == 2, "the last profile has two threads"
    return path


@pytest.mark.parametrize("threads", [None, 1, 2])
def test_it_replays_bit_by_bit(switched: Path, threads: int | None, started_threads: StartedThreads) -> None:
    report = replay(Session(switched), threads=threads)
    assert started_threads.most == (0 if threads == 1 else 2), "as recorded, the last profile has two"
    assert (report.verdict, report.first_difference, report.notes) == (Verdict.IDENTICAL, None, [])
    assert main(["replay", str(switched)]) == 0


def test_the_changes_matter_to_the_answers(switched: Path) -> None:
    """A replay without the changes gives other answers."""
    pipeline = Pipeline(Session(switched).profile)
    digest = 0
    for message in Session(switched).messages():
        match message.type:
            case "ObjectDescriptionArray":
                pipeline.on_shapes(message.data)
            case "ObjectStateArray":
                pipeline.on_states(message.data)
            case "MonitorStatus":
                digest = decode_status(message.data).digest
    assert pipeline.monitor.digest != digest


def test_what_changed_is_in_it_and_when(switched: Path) -> None:
    events = [decode_parameter_event(m.data) for m in Session(switched).messages() if m.type == "ParameterEvent"]
    assert [event.node for event in events] == [NODE, NODE]
    assert [event.stamp_ns for event in events] == [START + 21 * STEP, START + 36 * STEP]
    base = Profile()
    assert events[0].changed == {
        ("profile" if name == "name" else name): value for name, value in base.differences(FAST).items()
    }
    assert events[1].changed["threads"] == 2


def test_each_file_of_a_split_recording_has_the_settings_in_force(switched: Path, tmp_path: Path) -> None:
    record(tmp_path / "run", switches=SWITCHES, splitting=Splitting(size=1))
    profiles = [Session(path).profile for path in sorted(tmp_path.glob("run/*.mcap"), key=lambda p: (len(p.name), p))]
    changes = [k for k, (a, b) in enumerate(pairwise(profiles)) if a != b]
    assert [profiles[0], *(profiles[k + 1] for k in changes)] == [Profile(), *SWITCHES.values()]
    report = replay(Session(tmp_path / "run"))
    assert (report.verdict, report.digest) == (Verdict.IDENTICAL, replay(Session(switched)).digest)


def test_a_history_follows_the_changes_unless_a_profile_is_given(switched: Path) -> None:
    recorded, again = (read_history(Session(switched), profile) for profile in (None, AS_RECORDED))
    assert [changed["profile"] for _, changed in recorded.settings] == ["fast", "exact"]
    assert recorded.settings == again.settings
    assert np.array_equal(recorded.contacts.view(np.uint8), again.contacts.view(np.uint8))
    assert np.array_equal(recorded.predictions.view(np.uint8), again.predictions.view(np.uint8))
    other = read_history(Session(switched), "balanced")
    assert other.settings == []
    assert len(other.predictions) != len(recorded.predictions)


def test_the_points_of_a_contact_are_one_collision(switched: Path) -> None:
    one, four = (read_history(Session(switched), Profile(contact_points=most)) for most in (1, 4))
    answers = [decode_contacts(m.data).contacts for m in Session(switched).messages() if m.type == "ContactArray"]
    assert max(int(rows["point_count"].max()) for rows in answers if len(rows)) > 1
    assert [(c.pair, c.begin, c.end, c.deepest) for c in four.collisions] == [
        (c.pair, c.begin, c.end, c.deepest) for c in one.collisions
    ]
    assert len(four.contacts) == len(one.contacts)


def test_reports_and_checks_read_it(switched: Path, tmp_path: Path) -> None:
    assert main(["report", str(switched), "-o", str(tmp_path / "run.html")]) == 0
    text = (tmp_path / "run.html").read_text()
    assert "profile balanced, then fast, then exact" in text
    assert "settings changed" in text
    (tmp_path / "expect.yaml").write_text("expect:\n  - replay: identical\n")
    assert main(["check", str(switched), "--expect", str(tmp_path / "expect.yaml")]) == 0


def test_the_bytes_are_those_of_rclpy() -> None:
    serialization = pytest.importorskip("rclpy.serialization")
    from rcl_interfaces.msg import ParameterEvent
    from rclpy.parameter import Parameter

    values = {"flag": True, "count": -3, "size": 1.5, "name": "é", "corner": [1.0, 2.0, 3.0]}
    data = encode_parameter_event(5_000_000_007, NODE, values)
    theirs = serialization.deserialize_message(data, ParameterEvent)
    assert (theirs.stamp.sec, theirs.stamp.nanosec, theirs.node) == (5, 7, NODE)
    found = {each.name: Parameter.from_parameter_msg(each).value for each in theirs.changed_parameters}
    assert {name: list(v) if name == "corner" else v for name, v in found.items()} == values
    assert decode_parameter_event(serialization.serialize_message(theirs)).changed == values
    with pytest.raises(MessageError, match="truncated"):
        decode_parameter_event(data[:-20])
    with pytest.raises(MessageError, match="nothing: expected one of"):
        encode_parameter_event(0, NODE, {"nothing": None})


def test_settings_that_cannot_be_are_refused_and_change_nothing() -> None:
    pipeline = Pipeline()
    for changed in ({"horizon": -1.0}, {"unheard_of": 1}, {"threads": "two"}):
        pipeline.on_settings(encode_parameter_event(0, NODE, changed))
    pipeline.on_settings(b"\0\1\0\0")
    assert decode_status(pipeline.status()).refused_malformed == 4
    assert pipeline.monitor.profile == Profile()
    assert f"{NODE}/settings" == SETTINGS
