"""What publishers can make the pipeline keep and compute: every size has a bound, and the rest is refused."""

from __future__ import annotations

import gc
import struct
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from processor_time import within

from collision_monitor import codec, records
from collision_monitor.codec import Removal, encode_descriptions, encode_states
from collision_monitor.codec.cdr import REMEMBERED_STRINGS, _padded_string
from collision_monitor.codec.parameter_event import decode_parameter_event, encode_parameter_event
from collision_monitor.errors import MessageError, Refusal
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.state import memory_use
from collision_monitor.objects.description import MOST_NAME_BYTES, ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.shapes.convex_pieces import REMEMBERED_PIECES, convex_pieces
from collision_monitor.shapes.registry import ConvexHull, Mesh, Sphere

STAMP = 1_000_000_000_000
BALL = Sphere(0.5)


def describe(pipeline: Pipeline, *objects: codec.Change, snapshot: bool = False) -> list[codec.Change]:
    return pipeline.on_shapes(encode_descriptions(STAMP, "world", objects, snapshot=snapshot))


def states(*ids: int, at: float = 0.0) -> np.ndarray:
    rows = np.zeros(len(ids), records.STATE)
    rows["id"], rows["quaternion"][:, 3], rows["position"][:, 0] = ids, 1.0, at
    return rows


def grown(work: Callable[[int], None], rounds: int) -> int:
    """Bytes that Python holds in the end beyond those after the first half of the rounds."""
    tracemalloc.start()
    try:
        for k in range(rounds // 2):
            work(k)
        middle = tracemalloc.get_traced_memory()[0]
        for k in range(rounds // 2, rounds):
            work(k)
        return tracemalloc.get_traced_memory()[0] - middle
    finally:
        tracemalloc.stop()


def with_name(object_id: int, name: str) -> bytes:
    """A description as another publisher may send it, with a name that ours refuses to write."""
    mark = "n" * 60
    data = encode_descriptions(STAMP, "world", [ObjectDescription(object_id, BALL, name=mark)])
    at = data.index(mark.encode()) - 4
    raw = name.encode() + b"\0"
    padded = raw + bytes(-(len(raw) - 61) % 8)  # what follows keeps its alignment
    padded = name.encode() + b"x" * (len(padded) - len(raw)) + b"\0"
    return data[:at] + struct.pack("<I", len(padded)) + padded + data[at + 4 + 61 :]


# -- names


def test_a_long_name_is_refused_with_a_text_and_the_object_keeps_its_old_one() -> None:
    pipeline = Pipeline()
    describe(pipeline, ObjectDescription(7, BALL, name="forklift"))
    assert pipeline.on_shapes(with_name(7, "x" * 500_000)) == []
    assert pipeline.monitor.refused[Refusal.SHAPE] == 1
    assert "object 7, name: expected at most 256 bytes of UTF-8, got 5000" in pipeline.monitor.last_refusal
    assert len(pipeline.monitor.last_refusal) < 200
    assert pipeline.monitor.name(7) == "forklift"
    (change,) = pipeline.on_shapes(with_name(8, "y" * 200))
    assert isinstance(change, ObjectDescription) and change.name.startswith("y" * 200)


def test_names_that_are_described_again_and_again_do_not_stay() -> None:
    pipeline = Pipeline()
    describe(pipeline, ObjectDescription(2, BALL))

    def rename(k: int) -> None:
        describe(pipeline, ObjectDescription(1, BALL, name=f"{k:06d}{'ü' * 125}"))
        outputs = pipeline.on_states(encode_states(STAMP + k * 10_000_000, "world", k + 1, states(1, 2)))
        assert outputs is not None
        assert f"{k:06d}ü".encode() in outputs.contacts

    rename(0)
    assert grown(rename, 200) < 400_000
    assert _padded_string.held <= REMEMBERED_STRINGS
    for k in range(40_000):
        _padded_string(f"{k:06d}{'x' * (MOST_NAME_BYTES - 6)}")
    assert REMEMBERED_STRINGS // 2 < _padded_string.held <= REMEMBERED_STRINGS


def test_a_frame_of_a_megabyte_is_refused_and_not_kept() -> None:
    pipeline = Pipeline()
    frame = "w" * 1_000_000
    assert pipeline.on_states(encode_states(STAMP, frame, 1, states(1))) is None
    assert pipeline.on_shapes(encode_descriptions(STAMP, frame, [ObjectDescription(1, BALL)])) == []
    assert pipeline.monitor.refused[Refusal.FRAME] == 2
    assert "expected frame_id 'world', got 'www" in pipeline.monitor.last_refusal
    assert len(pipeline.status()) < 4_000


def test_a_profile_with_a_name_of_a_megabyte_is_refused() -> None:
    pipeline = Pipeline()
    pipeline.on_settings(encode_parameter_event(STAMP, "node", {"profile": "x" * 1_000_000}))
    assert pipeline.monitor.refused[Refusal.MALFORMED] == 1
    assert (pipeline.monitor.profile.name, len(pipeline.status()) < 4_000) == ("balanced", True)


# -- objects that come and go


def test_objects_that_come_and_go_without_any_step_leave_nothing() -> None:
    pipeline = Pipeline()

    def pass_by(k: int) -> None:
        ids = range(50 * k, 50 * k + 50)
        describe(pipeline, *(ObjectDescription(i, BALL) for i in ids))
        describe(pipeline, *map(Removal, ids))

    assert grown(pass_by, 60) < 120_000  # 1,500 objects; numpy keeps some small arrays
    assert pipeline.catalogue.facts() == {"static": [], "planar": False, "names": {}, "removed": [], "new": []}
    assert pipeline.monitor._roster.top == 50


def test_objects_that_come_and_go_between_steps_leave_nothing() -> None:
    pipeline = Pipeline()

    def pass_by(k: int) -> None:
        ids = range(50 * k, 50 * k + 50)
        describe(pipeline, *(ObjectDescription(i, BALL, name=f"{i % 50}") for i in ids), snapshot=True)
        outputs = pipeline.on_states(encode_states(STAMP + k * 10_000_000, "world", k + 1, states(*ids, at=50.0 * k)))
        assert outputs is not None
        assert outputs.result.status.objects == 50

    assert grown(pass_by, 40) < 100_000
    assert len(pipeline.catalogue.facts()["names"]) == 50


def test_many_descriptions_in_one_message_with_ids_at_the_ends_and_duplicates() -> None:
    pipeline = Pipeline()
    ids = [0, 2**32 - 1, 1, 2**32 - 2, *range(100, 1_600), 0, 2**32 - 1, *range(100, 600)]
    made = describe(pipeline, *(ObjectDescription(i, BALL, name=f"{n}") for n, i in enumerate(ids)))
    assert len(made) == len(ids)
    assert pipeline.monitor.ids == sorted(set(ids))
    assert pipeline.monitor.name(2**32 - 1) == str(len(ids) - 501)
    outputs = pipeline.on_states(encode_states(STAMP, "world", 1, states(0, 2**32 - 1)))
    assert outputs is not None
    assert [(c["id_a"], c["id_b"]) for c in outputs.result.contacts] == [(0, 2**32 - 1)]
    describe(pipeline, snapshot=True)
    assert pipeline.monitor.ids == []


def test_hulls_of_ever_other_sizes_leave_no_gaps() -> None:
    pipeline = Pipeline()
    rng = np.random.default_rng(0)
    for k in range(120):
        points = rng.normal(size=(8 * (k % 60) + 8, 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True)  # all of them are corners
        describe(pipeline, ObjectDescription(1, ConvexHull(points)))
    assert len(pipeline.monitor._roster.multibody.table.vertex_index) <= 6 * 480  # 14,640 before


def test_meshes_leave_no_pieces() -> None:
    vertices = np.random.default_rng(0).normal(size=(300, 3))
    faces = np.random.default_rng(1).integers(0, 300, (9_000, 3))
    for _ in range(8):
        assert len(convex_pieces(Mesh(vertices, faces))) == 9_000
    assert REMEMBERED_PIECES // 2 < convex_pieces.held <= REMEMBERED_PIECES


# -- the bound of all objects


def test_the_memory_of_all_objects_has_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory_use, "MOST_MEMORY", 1 << 20)
    pipeline = Pipeline()
    made = describe(pipeline, *(ObjectDescription(i, BALL) for i in range(600)))
    most = len(made)
    assert 280 < most < 400
    assert pipeline.monitor.refused[Refusal.SHAPE] == 600 - most
    text = f"expected all objects together to need at most 1 MiB, got 1.0 MiB with {most + 1} objects; remove objects"
    assert text in pipeline.monitor.last_refusal
    assert len(describe(pipeline, ObjectDescription(0, BALL, name="again"))) == 1, "a known object needs no new memory"
    large = ConvexHull(np.random.default_rng(0).normal(size=(10_000, 3)))
    assert describe(pipeline, ObjectDescription(0, large)) == []
    assert describe(pipeline, Removal(1), ObjectDescription(999, BALL))[1].object_id == 999
    assert describe(pipeline, snapshot=True) != []
    assert len(describe(pipeline, *(ObjectDescription(i, BALL) for i in range(600)))) == most, "nothing is left"


def test_what_an_object_is_counted_for_is_no_less_than_it_needs() -> None:
    rng = np.random.default_rng(0)
    kinds: dict[str, Callable[[int], ObjectDescription]] = {
        "balls": lambda i: ObjectDescription(i, BALL, name="n" * MOST_NAME_BYTES),
        "hulls": lambda i: ObjectDescription(i, ConvexHull(rng.normal(size=(100, 3)))),
        "allowed": lambda i: ObjectDescription(i, BALL, allowed=tuple(range(10_000 * i, 10_000 * i + 100))),
    }
    for kind, make in kinds.items():
        fill(Pipeline().monitor, make)  # what the first of a kind loads is not the object's
        monitor = Pipeline().monitor
        gc.collect()
        tracemalloc.start()
        kept = fill(monitor, make)
        assert monitor._roster.allowed_keys is not None
        gc.collect()
        needed = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        counted = sum(memory_use.object_memory(d) for d in kept)
        assert 0.2 * counted < needed <= counted, kind


def fill(monitor: Monitor, make: Callable[[int], ObjectDescription]) -> list[ObjectDescription]:
    """Describe 520 objects, and return them; the arrays have room for 1,024 then."""
    made = [make(i) for i in range(520)]
    for d in made:
        monitor.describe(d)
    return made


# -- time


def test_allowed_pairs_of_a_megabyte_take_no_quadratic_time() -> None:
    pipeline = Pipeline()
    describe(pipeline, ObjectDescription(5_000, BALL))
    message = [ObjectDescription(i, BALL, allowed=tuple(range(i, i + 200))) for i in range(1_000)]
    with within(5.0):  # 88 s before
        assert len(describe(pipeline, *message)) == 1_000
        outputs = pipeline.on_states(encode_states(STAMP, "world", 1, states(0, 100, 300, 600)))
    assert outputs is not None
    checked = {(0, 300), (0, 600), (100, 300), (100, 600), (300, 600)}  # 0 allows 0 to 199, 100 allows 100 to 299
    assert {(c["id_a"], c["id_b"]) for c in outputs.result.contacts} == checked


def test_a_touching_pair_ends_when_it_is_allowed_by_either_object() -> None:
    for object_id, other in ((1, 2), (2, 1)):
        pipeline = Pipeline()
        describe(pipeline, ObjectDescription(1, BALL), ObjectDescription(2, BALL), ObjectDescription(3, BALL))
        outputs = pipeline.on_states(encode_states(STAMP, "world", 1, states(1, 2, 3)))
        assert outputs is not None
        assert len(outputs.result.contacts) == 3
        describe(pipeline, ObjectDescription(object_id, BALL, allowed=(other,)))
        outputs = pipeline.on_states(encode_states(STAMP + 10_000_000, "world", 2, states(1, 2, 3)))
        assert outputs is not None
        ended = outputs.result.ended
        assert [(c["id_a"], c["id_b"]) for c in ended] == [(1, 2)]


HEADER = b"\x00\x01\x00\x00" + struct.pack("<iII", 1, 0, 6) + b"world\0\0\0"
ALL = struct.pack("<I", 0xFFFFFFFF)
CLAIMS = {
    "states": (codec.decode_states, HEADER + struct.pack("<I", 1) + ALL),
    "covariance": (codec.decode_states, HEADER + struct.pack("<II", 1, 0) + ALL),
    "descriptions": (codec.decode_descriptions, HEADER[:-2] + b"\0\0" + ALL),
    "contacts": (codec.decode_contacts, HEADER + bytes(8) + ALL),
    "predictions": (codec.decode_predictions, HEADER + bytes(16) + ALL),
    "frame": (codec.decode_status, HEADER[:12] + ALL),
    "parameters": (decode_parameter_event, HEADER[:12] + struct.pack("<I", 1) + bytes(4) + ALL),
}


@pytest.mark.parametrize("name", CLAIMS)
def test_a_length_beyond_the_message_allocates_nothing(name: str) -> None:
    decode, data = CLAIMS[name]
    for rest in (b"", bytes(100), bytes(1_000_000)):
        message = data + rest
        tracemalloc.start()
        with within(0.1, name), pytest.raises(MessageError, match="expected"):
            decode(message)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 100_000
