"""The pipeline with the real monitor: decoded input bytes, counted refusals, encoded answers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from collision_monitor import codec, records
from collision_monitor.codec import (
    decode_contacts,
    decode_descriptions,
    decode_predictions,
    decode_status,
    encode_descriptions,
    encode_states,
)
from collision_monitor.errors import Refusal
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Outputs, Pipeline
from collision_monitor.records import Model
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, HalfSpace, Sphere

STEP = 10_000_000
START = 1_000_000_000_000


def ball(object_id: int, **fields: Any) -> ObjectDescription:
    return ObjectDescription(object_id, Sphere(0.5), **{"name": f"ball {object_id}", **fields})


def rows(*at: tuple[int, float, float]) -> np.ndarray:
    """Return states of (id, x, speed along x)."""
    states = np.zeros(len(at), records.STATE)
    states["quaternion"][:, 3] = 1.0
    for row, (object_id, x, speed) in zip(states, at, strict=True):
        row["id"], row["position"][0], row["linear"][0] = object_id, x, speed
    return states


class Run:
    """A pipeline and the clock of its inputs."""

    def __init__(self, *objects: ObjectDescription, frame_id: str = "world") -> None:
        self.pipeline = Pipeline("balanced", frame_id=frame_id)
        self.stamp = START
        self.sequence = 0
        self.describe(*objects)

    def describe(self, *objects: codec.Change, snapshot: bool = False, frame: str = "world") -> None:
        self.pipeline.on_shapes(encode_descriptions(self.stamp, frame, objects, snapshot=snapshot))

    def step(
        self,
        states: np.ndarray,
        covariance: np.ndarray | None = None,
        frame: str = "world",
        sequence: int | None = None,
    ) -> Outputs | None:
        self.stamp += STEP
        self.sequence += 1
        number = self.sequence if sequence is None else sequence
        return self.pipeline.on_states(encode_states(self.stamp, frame, number, states, covariance))

    @property
    def status(self) -> codec.MonitorStatus:
        return decode_status(self.pipeline.status())

    def refused(self, reason: Refusal) -> int:
        return int(getattr(self.status, f"refused_{reason.value}"))


def test_answers_carry_the_step_the_frame_and_the_names() -> None:
    run = Run(ball(1), ball(2), ball(30), ball(4))
    outputs = run.step(rows((1, 0.0, 0.0), (2, 0.9, 0.0), (30, 4.0, -2.0), (4, 100.0, 0.0)))
    assert outputs is not None
    contacts, predictions = decode_contacts(outputs.contacts), decode_predictions(outputs.predictions)
    assert (contacts.stamp_ns, contacts.frame_id, contacts.step) == (run.stamp, "world", 1)
    assert (predictions.stamp_ns, predictions.frame_id, predictions.step) == (run.stamp, "world", 1)
    assert predictions.horizon == run.pipeline.monitor.profile.horizon
    assert contacts.ids.tolist() == [1, 2]
    assert contacts.names == ["ball 1", "ball 2"]
    (contact,) = contacts.contacts
    assert contact["signed_distance"] == pytest.approx(-0.1, abs=1e-12)
    first = predictions.predictions[0]
    assert (first["id_a"], first["id_b"]) == (2, 30)
    assert first["lower"] <= (4.0 - 0.9 - 1.0) / 2.0 <= first["upper"]
    assert dict(zip(predictions.ids.tolist(), predictions.names, strict=True))[30] == "ball 30"
    assert 4 not in predictions.ids
    assert outputs.digest == run.status.digest != 0


def test_the_same_bytes_give_the_same_bytes() -> None:
    def all_outputs() -> list[tuple[bytes, bytes, int]]:
        run = Run(ball(1), ball(2), ball(3))
        steps = [run.step(rows((1, 0, 0), (2, 2 - 0.05 * k, -5.0), (3, 5, -1))) for k in range(40)]
        return [(o.contacts, o.predictions, o.digest) for o in steps if o is not None]

    first = all_outputs()
    assert len(first) == 40
    assert first == all_outputs()


def test_a_removed_object_is_still_named_where_its_contact_ends() -> None:
    run = Run(ball(1), ball(2))
    run.step(rows((1, 0, 0), (2, 0.5, 0)))
    run.describe(codec.Removal(2))
    outputs = run.step(rows((1, 0, 0)))
    assert outputs is not None
    contacts = decode_contacts(outputs.contacts)
    assert contacts.contacts["phase"].tolist() == [records.Phase.END]
    assert contacts.names == ["ball 1", "ball 2"]


def test_an_object_removed_and_described_again_has_its_new_name() -> None:
    run = Run(ball(1), ball(2))
    run.step(rows((1, 0, 0), (2, 0.5, 0)))
    run.describe(codec.Removal(2), ball(2, name="new"))
    outputs = run.step(rows((1, 0, 0), (2, 0.5, 0)))
    assert outputs is not None
    assert decode_contacts(outputs.contacts).names == ["ball 1", "new"]


def test_a_snapshot_removes_what_is_not_in_it() -> None:
    run = Run(ball(1), ball(2), ball(3))
    run.describe(ball(2), ball(9))
    assert run.pipeline.monitor.ids == [1, 2, 3, 9]
    run.describe(ball(2), ball(5), snapshot=True)
    assert run.pipeline.monitor.ids == [2, 5]
    run.describe(snapshot=True)
    assert run.pipeline.monitor.ids == []


def test_a_snapshot_keeps_a_known_object_whose_new_description_is_refused() -> None:
    run = Run(ball(1), ball(2))
    moving_floor = ObjectDescription(2, HalfSpace((0, 0, 1)), name="a floor that moves")
    run.describe(ball(1), moving_floor, snapshot=True)
    assert run.pipeline.monitor.ids == [1, 2]
    assert run.refused(Refusal.SHAPE) == 1
    assert run.pipeline.monitor.name(2) == "ball 2"


def test_an_unsupported_object_is_refused_and_never_counted_as_monitored() -> None:
    run = Run()
    run.describe(ObjectDescription(7, HalfSpace((0, 0, 1))), ball(1))
    outputs = run.step(rows((1, 0, 0), (7, 0, 0)))
    assert outputs is not None
    status = run.status
    assert (status.objects, status.refused_shape, status.refused_unknown_id) == (1, 1, 1)
    run.describe(ObjectDescription(8, HalfSpace((0, 0, 1))))
    assert "HalfSpace" in run.status.last_refusal


def test_removing_what_is_not_there_is_no_refusal() -> None:
    run = Run()
    run.describe(codec.Removal(5))
    assert run.status.last_refusal == ""


def test_a_static_object_stands_where_its_description_says() -> None:
    run = Run(ball(1), ball(2, static=True, pose=Pose((3.0, 0, 0))))
    outputs = run.step(rows((1, 2.5, 0)))
    assert outputs is not None
    (contact,) = decode_contacts(outputs.contacts).contacts
    assert contact["signed_distance"] == pytest.approx(-0.5, abs=1e-12)
    assert run.status.objects_static == 1


@pytest.mark.parametrize("frame", ["map", "world/", "World"])
def test_another_frame_is_refused(frame: str) -> None:
    run = Run(ball(1))
    assert run.step(rows((1, 0, 0)), frame=frame) is None
    run.describe(ball(2), frame=frame)
    assert run.refused(Refusal.FRAME) == 2
    assert run.pipeline.monitor.ids == [1]
    assert f"expected frame_id 'world', got {frame!r}" in run.status.last_refusal


def test_an_empty_frame_is_ours() -> None:
    run = Run(ball(1))
    assert run.step(rows((1, 0, 0)), frame="") is not None
    run.describe(ball(2), frame="")
    assert run.pipeline.monitor.ids == [1, 2]


def test_malformed_messages_are_refused_and_the_next_one_is_not() -> None:
    run = Run(ball(1))
    good = encode_states(START, "world", 1, rows((1, 0, 0)))
    for bad in (b"", good[:-1], good + bytes(100), b"\0\0\0\0" + good[4:], b"hello"):
        assert run.pipeline.on_states(bad) is None
        run.pipeline.on_shapes(bad)
    assert run.refused(Refusal.MALFORMED) == 10
    assert run.pipeline.on_states(good) is not None


def test_a_covariance_of_another_length_is_malformed() -> None:
    run = Run(ball(1))
    assert run.step(rows((1, 0, 0)), np.zeros(11)) is None
    assert run.refused(Refusal.MALFORMED) == 1
    assert "expected none or 12 numbers for each of 1 states, got 11" in run.status.last_refusal


def test_a_refused_stamp_gives_no_new_answer() -> None:
    run = Run(ball(1))
    assert run.step(rows((1, 0, 0))) is not None
    before = run.status
    run.stamp += 60 * 10**9
    assert run.step(rows((1, 0, 0))) is None
    after = run.status
    assert (after.refused_time, after.step, after.digest) == (1, before.step, before.digest)


def approaching() -> np.ndarray:
    """Return states of two balls that meet in 0.85 s by their states, with paths 0.6 m apart."""
    states = rows((1, 0, 0), (2, 2.5, -2))
    states["position"][1, 1] = 0.6
    return states


def test_unknown_standard_deviations_are_none() -> None:
    states = approaching()
    for name in ("position_stddev", "orientation_stddev", "velocity_stddev", "angular_velocity_stddev"):
        states[name] = np.nan
    outputs = Run(ball(1), ball(2)).step(states)
    assert outputs is not None
    assert np.isnan(outputs.result.predictions["probability"]).tolist() == [True]


def test_a_covariance_takes_the_place_of_both_standard_deviations() -> None:
    """Errors along the path determine when they meet, errors across it whether they meet."""
    probabilities = []
    for along, across in ((0.3, 0.0), (0.0, 0.3)):
        states = approaching()
        states["position_stddev"] = 9.0
        covariance = np.zeros((2, 12))
        covariance[0, 0], covariance[0, 3] = along**2, across**2
        outputs = Run(ball(1), ball(2)).step(states, covariance.ravel())
        assert outputs is not None
        probabilities.append(float(outputs.result.predictions["probability"][0]))
    assert probabilities[0] == pytest.approx(1.0)
    assert 0.8 < probabilities[1] < 0.95  # 0.4 m away from just touching: 1.33 standard deviations


@pytest.mark.parametrize(("value", "refused"), [(np.nan, 0), (np.inf, 1), (-4.0, 1), (1e308, 1)])
def test_covariances_that_are_none(value: float, refused: int) -> None:
    run = Run(ball(1))
    run.step(rows((1, 0, 0)), np.array([value, 0, 0, value, 0, value, *np.zeros(6)]))
    assert run.status.refused_non_finite == refused


@pytest.mark.parametrize(
    ("sequences", "lost"),
    [
        ([0, 0, 0], 0),  # a publisher that does not count
        ([1, 2, 3], 0),
        ([1, 3, 7], 4),
        ([5, 5, 6], 0),  # the same number twice
        ([2**32 - 2, 2**32 - 1, 0, 1], 0),  # the counter's wrap
        ([2**32 - 2, 1], 2),
        ([900, 901, 1, 2], 0),  # a publisher that restarts
        ([3_000_000_000, 0, 1], 0),
    ],
)
def test_lost_messages_are_counted_from_gaps(sequences: list[int], lost: int) -> None:
    run = Run(ball(1))
    for sequence in sequences:
        run.step(rows((1, 0, 0)), sequence=sequence)
    assert run.status.messages_lost == lost


def test_the_status_before_the_first_step_knows_the_scene() -> None:
    run = Run(ball(1), ball(2), ball(3, static=True, pose=Pose()))
    status = run.status
    assert (status.objects, status.objects_static, status.objects_unseen, status.step) == (3, 1, 2, 0)
    assert status.version
    assert (status.profile, status.frame_id) == ("balanced", "world")


def test_the_status_takes_the_live_fields_and_silence_makes_all_stale() -> None:
    run = Run(ball(1), ball(2), ball(3), ball(4, static=True, pose=Pose((50, 0, 0))))
    run.step(rows((1, 0, 0), (2, 10, 0)))
    status = decode_status(
        run.pipeline.status(silent=True, step_duration=0.5, recording=2, recording_error="disk full")
    )
    assert (status.objects_stale, status.objects_unseen) == (2, 1)
    assert (status.step_duration, status.recording, status.recording_error) == (0.5, 2, "disk full")
    assert run.status.objects_stale == 0


@given(st.data())
def test_no_message_makes_the_pipeline_raise(data: st.DataObject) -> None:
    """Feed mutated messages to one pipeline; afterwards it still answers a good one."""
    run = Run(ball(1), ball(2))
    good = [
        encode_states(run.stamp, "world", 1, rows((1, 0, 0), (2, 3, -1)), np.arange(24.0)),
        encode_descriptions(run.stamp, "world", [ball(2), ball(3)], snapshot=True),
    ]
    for _ in range(5):
        kind = data.draw(st.integers(0, 1))
        message = bytearray(good[kind])
        for _ in range(data.draw(st.integers(1, 4))):
            at = data.draw(st.integers(12, len(message) - 1))
            message[at : at + 1] = data.draw(st.sampled_from([b"\xff", b"\0", b"\x7f", b"\xf0", b"\x01", b""]))
        (run.pipeline.on_shapes if kind else run.pipeline.on_states)(bytes(message))
        run.pipeline.status()
    run.describe(ball(1), ball(2), snapshot=True)
    run.stamp = max(run.stamp, run.status.stamp_ns)
    outputs = run.step(rows((1, 0, 0), (2, 0.5, 0)))
    outputs = outputs or run.step(rows((1, 0, 0), (2, 0.5, 0)))  # the pipeline may refuse the first one for its stamp
    assert outputs is not None


def test_a_profile_with_other_models_holds_for_what_is_described_already() -> None:
    """Contacts persist, a model chosen by a description stays, and a replay of the changes gives the same answers."""
    boxes = [ObjectDescription(k, Box((1, 1, 1)), name=f"box {k}") for k in (1, 2)]
    own = ObjectDescription(3, Box((1, 1, 1)), model=Model.OBB)
    run, other = Run(*boxes, own), Run(*boxes, own)
    reported = []
    changes: list[dict[str, Any]] = [{}, {"model_primitive": "sphere"}, {"threads": 2}, {"model_primitive": "auto"}]
    for models in changes:
        change = run.pipeline.change_settings(run.pipeline.monitor.profile.replace(**models), run.stamp)
        assert (change.shapes is not None) == ("model_primitive" in models)
        other.pipeline.on_settings(change.settings)
        if change.shapes is not None:
            assert [it.object_id for it in decode_descriptions(change.shapes).objects] == [1, 2]
            other.pipeline.on_shapes(change.shapes)
        answers = [each.step(rows((1, 0.0, 0.0), (2, 0.9, 0.0), (3, 5.0, 0.0))) for each in (run, other)]
        assert answers[0] is not None and answers[1] is not None
        assert answers[0].contacts == answers[1].contacts
        assert answers[0].predictions == answers[1].predictions
        reported.append(answers[0].result.contacts[0])
    assert [Model(row["model_a"]) for row in reported] == [Model.EXACT, Model.SPHERE, Model.SPHERE, Model.EXACT]
    begin, persist = records.Phase.BEGIN, records.Phase.PERSIST
    assert [row["phase"] for row in reported] == [begin, persist, persist, persist]
    assert np.all(np.diff([row["duration"] for row in reported]) > 0.0)
