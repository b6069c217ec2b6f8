"""What is on the page at a time of a session equals what its messages say, in whatever order the times are visited."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from played_session import drive_states, record_states

from collision_monitor.errors import SessionError
from collision_monitor.session import Session
from collision_monitor.settings.profile import Profile
from collision_monitor.view.picture import Picture, Role, draw
from collision_monitor.view.recording import APART, RecordedSteps


@dataclass
class Step:
    """A step as another reader sees it: positions and quaternions by id, and the answers."""

    stamp: int
    poses: dict[int, tuple[float, ...]] = field(default_factory=dict)
    contacts: list[Any] = field(default_factory=list)
    predictions: list[Any] = field(default_factory=list)


def steps_of(path: Path) -> list[Step]:
    """Return the steps of a session by the mcap package and mcap_ros2, without any code of ours."""
    factory, poses, static, known = DecoderFactory(), {}, {}, set()
    steps: dict[int, Step] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
            decode = factory.decoder_for(channel.message_encoding, schema)
            try:
                data = decode(message.data)
            except Exception:  # deliberately cut
                continue
            name = schema.name.rpartition("/")[2]
            if name == "ObjectDescriptionArray":
                for each in data.objects:
                    (known.discard if each.operation == 1 else known.add)(each.id)
                    poses.pop(each.id, None) if each.operation == 1 else None
                    if each.operation == 0 and each.is_static:
                        static[each.id] = pose(each.pose)
            elif name == "ObjectStateArray" and data.header.frame_id == "world":
                poses |= {each.id: pose(each.pose) for each in data.states if each.id in known}
            elif name in ("ContactArray", "PredictedCollisionArray"):
                stamp = data.header.stamp.sec * 10**9 + data.header.stamp.nanosec
                step = steps.setdefault(data.step, Step(stamp, static | poses))
                if name == "ContactArray":
                    step.contacts = [each for each in data.contacts if each.phase != 2]
                else:
                    step.predictions = list(data.predictions)
    return list(steps.values())


def pose(message: Any) -> tuple[float, ...]:
    p, q = message.position, message.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def assert_shows(picture: Picture, step: Step) -> None:
    """Compare a picture with a step: single-piece bodies at their poses, contact points, and the list of pairs."""
    batches = [batch for (role, _), batch in picture.batches.items() if role is not Role.IMPACT]
    shown = {int(i): None for batch in batches for i in batch.ids}
    assert set(shown) == set(step.poses)
    for batch in batches:
        if batch.form.name != "box":
            continue
        for object_id, position, wxyz in zip(batch.ids, batch.position, batch.wxyz, strict=True):
            expected = step.poses[int(object_id)]
            np.testing.assert_allclose(position, expected[:3], atol=1e-6)
            np.testing.assert_allclose(wxyz[[1, 2, 3, 0]], expected[3:], atol=1e-6)
    points = [(each.point_a.x, each.point_a.y, each.point_a.z) for each in step.contacts]
    finite = [point for point in points if np.isfinite(point).all()]
    np.testing.assert_allclose(picture.contacts, np.reshape(finite, (-1, 3)), atol=1e-6)
    pairs = [(each.id_a, each.id_b) for each in step.contacts if each.point_index == 0]
    pairs += [(each.id_a, each.id_b) for each in step.predictions]
    assert [row.pair for row in picture.rows] == pairs[: len(picture.rows)]
    assert len(picture.rows) == min(len(pairs), 8)


def test_the_page_shows_what_the_messages_say_back_and_forth(golden: Path) -> None:
    expected = steps_of(golden)
    recording = RecordedSteps(Session(golden))
    assert len(recording) == len(expected) == 300
    assert recording.times == pytest.approx([(step.stamp - expected[0].stamp) * 1e-9 for step in expected])
    order = np.random.default_rng(3).integers(0, 300, 60).tolist()
    for frame in [299, 0, APART, APART - 1, APART + 1, *range(15, 35), 2 * APART - 1, 2 * APART, *order, 0]:
        assert_shows(draw(recording.moment(frame)), expected[frame])


def test_a_moment_does_not_depend_on_the_way_to_it(golden: Path) -> None:
    straight, jumping = RecordedSteps(Session(golden)), RecordedSteps(Session(golden))
    for frame in (250, 30, 31, 249, 64, 63, 29):
        far = jumping.moment(frame)
        for k in range(frame + 1) if frame < 32 else (frame,):
            near = straight.moment(k)
        assert near.state.tobytes() == far.state.tobytes() and near.step == far.step
        assert near.names == far.names and near.contacts.tobytes() == far.contacts.tobytes()


def test_beginning_contacts_and_times_are_found(drive: Path) -> None:
    recording = RecordedSteps(Session(drive))
    (begin,) = recording.begins
    assert begin.pair == (1, 2)
    assert recording.times[begin.frame] == pytest.approx(1.5, abs=0.03)
    assert recording.names[2] == "post"
    assert recording.frame_at(-1.0) == 0 and recording.frame_at(1e9) == len(recording) - 1
    assert recording.frame_at(recording.times[7]) == 7
    assert recording.frame_at(recording.times[7] + 0.001) == 7


def test_a_replay_shows_the_answers_of_another_profile(drive: Path) -> None:
    profile = Profile.named("exact").replace(horizon=0.75)
    recorded, replayed = RecordedSteps(Session(drive)), RecordedSteps(Session(drive), profile)
    assert len(recorded) == len(replayed)
    ours, theirs = recorded.moment(0), replayed.moment(0)
    assert ours.state.tobytes() == theirs.state.tobytes()
    assert (ours.horizon, theirs.horizon) == (2.0, 0.75)
    assert len(ours.predictions) == 2 and not len(theirs.predictions)


def test_without_answers_nothing_is_shown_as_clear(tmp_path: Path) -> None:
    path = record_states(tmp_path / "inputs.mcap", *drive_states(0.5), answers=False)
    recording = RecordedSteps(Session(path))
    assert len(recording) == 25 and "--replay" in recording.problems[0]
    picture = draw(recording.moment(10))
    assert not picture.is_known and not picture.rows
    moving = picture.batches[Role.MOVING, "box"]
    answered = draw(RecordedSteps(Session(path), Profile.named("exact")).moment(10))
    assert (moving.color != answered.batches[Role.MOVING, "box"].color).any()


def test_a_session_without_shapes_shows_the_pairs(tmp_path: Path, golden: Path) -> None:
    from session_scene import TYPES

    from collision_monitor.session import Recorder

    session = Session(golden)
    with Recorder(tmp_path / "bare.mcap", TYPES, session.metadata) as recorder:
        for message in session.messages():
            if message.type != "ObjectDescriptionArray":
                recorder.write(message.topic, message.data, message.log_time, message.publish_time)
    recording = RecordedSteps(Session(tmp_path / "bare.mcap"))
    picture = draw(recording.moment(100))
    assert not picture.batches and picture.rows and picture.rows[0].names[0].startswith("body")


def test_an_empty_session_is_refused(tmp_path: Path) -> None:
    path = record_states(tmp_path / "empty.mcap", drive_states(0.1)[0], [])
    with pytest.raises(SessionError, match="expected object states, found none"):
        RecordedSteps(Session(path))
