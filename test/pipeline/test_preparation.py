"""Descriptions that take long, with the real process that makes their models; and descriptions that must not raise."""

from __future__ import annotations

import gc
import time
from collections.abc import Iterator

import numpy as np
import pytest
import trimesh

from collision_monitor import ConvexHull, HalfSpace, Mesh, Points, Polygon, Pose, Sphere
from collision_monitor.codec import Removal, decode_contacts, decode_status, encode_descriptions, encode_states
from collision_monitor.errors import Refusal
from collision_monitor.monitor.state import roster
from collision_monitor.objects.description import MOST_SHAPES, ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.preparation import STAYS, Preparation
from collision_monitor.pipeline.shape_intake import TakenShapes
from collision_monitor.records import STATE, Model
from collision_monitor.session.replaying.difference import compare_status
from collision_monitor.settings.profile import Profile

PATIENCE = 30.0
"""s for the process to start and to make a model; on a loaded machine."""

LIMIT = 0.1
"""s that the objects of one message of up to 1 MB may take, unless it is stated to be longer."""

NOISE = 2.5
"""Allowed factor on the time, because the tests share the machine."""


def dented(subdivisions: int, phase: float = 0.0) -> Mesh:
    """A concave, closed mesh of 20 * 4^subdivisions faces."""
    it = trimesh.creation.icosphere(subdivisions)
    return Mesh(it.vertices * (1.0 + 0.3 * np.sin(5 * it.vertices[:, :1] + phase)), it.faces)


HEAVY = dented(3)
HULLS = Profile.named("balanced").replace(model_mesh="convex_hull")  # an exact mesh is not heavy
BALL = ObjectDescription(2, Sphere(0.5))


def states(*at: tuple[int, float]) -> np.ndarray:
    rows = np.zeros(len(at), STATE)
    rows["quaternion"][:, 3] = 1.0
    for row, (object_id, x) in zip(rows, at, strict=True):
        row["id"], row["position"][0] = object_id, x
    return rows


class Run:
    """A pipeline with a preparation, and every input as it was taken."""

    def __init__(self, preparation: Preparation) -> None:
        self.preparation = preparation
        self.pipeline = Pipeline(HULLS, preparation=self.preparation)
        self.inputs: list[tuple[str, bytes]] = []
        self.answers: list[tuple[bytes, bytes]] = []
        self.texts: list[str] = []
        self.stamp = 10**9

    def describe(self, *objects: ObjectDescription | Removal, snapshot: bool = False) -> TakenShapes:
        taken = self.pipeline.take_shapes(encode_descriptions(self.stamp, "world", objects, snapshot=snapshot))
        self.inputs.append(("shapes", taken.data))
        return taken

    def step(self, *at: tuple[int, float]) -> np.ndarray:
        self.stamp += 10**7
        data = encode_states(self.stamp, "world", 0, states(*at))
        self.inputs.append(("states", data))
        outputs = self.pipeline.on_states(data)
        assert outputs is not None
        self.answers.append((outputs.contacts, outputs.predictions))
        return decode_contacts(outputs.contacts).contacts

    def wait(self) -> list[TakenShapes]:
        """Wait until something ends; return what was taken."""
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            taken, texts = self.pipeline.take_prepared()
            self.inputs += [("shapes", each.data) for each in taken]
            self.texts += texts
            if taken or texts:
                return taken
            time.sleep(0.01)
        raise AssertionError("expected a model or a text in time")

    def replayed(self) -> list[tuple[bytes, bytes]]:
        """The answers to the inputs as they were taken, of a pipeline without a preparation and without a clock."""
        pipeline, answers = Pipeline(HULLS, timed=False), []
        for kind, data in self.inputs:
            if kind == "shapes":
                pipeline.on_shapes(data)
            else:
                outputs = pipeline.on_states(data)
                assert outputs is not None
                answers.append((outputs.contacts, outputs.predictions))
        assert pipeline.monitor.digest == self.pipeline.monitor.digest
        return answers

    @property
    def last_refusal(self) -> str:
        return decode_status(self.pipeline.status()).last_refusal


@pytest.fixture(scope="module")
def started() -> Iterator[Preparation]:
    """One process for all tests, as it takes seconds to start."""
    preparation = Preparation()
    yield preparation
    preparation.close()


@pytest.fixture
def run(started: Preparation) -> Run:
    with started._wake:
        started._models.clear()
        started._waiting.clear()
        started._waiting_bytes = 0
    return Run(started)


def test_a_heavy_object_has_its_box_at_once_and_its_own_model_later_and_a_replay_repeats_both(run):
    run.describe(BALL)  # loads kernels
    run.step((2, 1.0))
    began = time.perf_counter()
    run.describe(ObjectDescription(1, HEAVY))
    assert time.perf_counter() - began < NOISE * LIMIT
    (box,) = run.step((1, 0.0), (2, 1.0))
    assert box["model_a"] == Model.AABB and box["error_bound"] > 0.5
    (again,) = run.wait()
    assert [each.object_id for each in again.changes] == [1]
    (hull,) = run.step((1, 0.0), (2, 1.0))
    assert hull["model_a"] == Model.CONVEX_HULL and hull["error_bound"] < box["error_bound"]
    assert hull["signed_distance"] > box["signed_distance"]
    assert run.replayed() == run.answers
    assert not sum(run.pipeline.monitor.refused.values())


def test_the_session_gets_the_message_with_other_models_only(run):
    objects = [ObjectDescription(1, HEAVY, name="odd"), BALL, ObjectDescription(3, dented(3, 1.0), model=Model.OBB)]
    data = encode_descriptions(5, "world", objects, snapshot=True)
    taken = run.pipeline.take_shapes(data).data
    assert len(taken) == len(data)
    differing = [(a, b) for a, b in zip(data, taken, strict=True) if a != b]
    assert differing == [(Model.AUTO, Model.AABB), (Model.OBB, Model.AABB)]


def test_ordinary_objects_are_taken_as_they_are(run):
    small = [ObjectDescription(1, dented(0)), BALL, ObjectDescription(3, ConvexHull(dented(1).vertices))]
    data = encode_descriptions(5, "world", small)
    assert run.pipeline.take_shapes(data).data is data
    assert not run.preparation._waiting


def test_the_same_shape_again_needs_no_box(run):
    run.describe(ObjectDescription(1, HEAVY), BALL)
    run.wait()
    data = encode_descriptions(9, "world", [ObjectDescription(7, Mesh(HEAVY.vertices, HEAVY.faces)), BALL])
    assert run.pipeline.take_shapes(data).data is data
    assert not run.preparation._waiting


def test_a_model_that_takes_too_long_is_given_up_and_said():
    pytest.importorskip("coacd")
    run = Run(Preparation(limit=0.05))
    try:
        run.describe(ObjectDescription(1, dented(2), model=Model.CONVEX_DECOMPOSITION), BALL)
        assert run.wait() == []
        (text,) = run.texts
        assert text == f"object 1: the model takes longer than 0.05 s; it {STAYS}"
        assert run.last_refusal == text
        pipeline = Pipeline(HULLS, timed=False)
        pipeline.on_shapes(run.inputs[0][1])
        recorded, replayed = run.pipeline.status(), pipeline.status()
        assert recorded != replayed and compare_status("status", 0, recorded, replayed) is None
        (box,) = run.step((1, 0.0), (2, 1.0))
        assert box["model_a"] == Model.AABB
        assert run.replayed() == run.answers
        run.preparation._limit = PATIENCE  # the process starts again for the next one
        run.describe(ObjectDescription(3, HEAVY))
        assert [change.object_id for taken in run.wait() for change in taken.changes] == [3]
    finally:
        run.preparation.close()


def test_an_impossible_model_leaves_the_box_and_says_why(run):
    pytest.importorskip("coacd")
    open_mesh = Mesh(HEAVY.vertices, HEAVY.faces[1:])
    run.describe(ObjectDescription(1, open_mesh, model=Model.CONVEX_DECOMPOSITION), BALL)
    assert run.wait() == []
    assert "object 1: convex decomposition: expected a closed mesh" in run.texts[0] and STAYS in run.texts[0]
    run.pipeline.monitor.refuse(Refusal.SHAPE, "another one")
    assert run.last_refusal == "another one"


def test_a_replay_refuses_an_object_that_has_no_box_for_the_same_reason():
    """It has no model of its own either, but that is known only where there is the time to make one."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.6e18, 0.6e18, (12_000, 3))
    run = Run(Preparation(limit=0.0))
    taken = run.describe(ObjectDescription(1, Points(points, 0.1), model=Model.CONVEX_DECOMPOSITION), BALL)
    assert [each.object_id for each in taken.changes] == [2]
    assert "1e+18" in run.last_refusal
    again = Pipeline(HULLS, timed=False)
    again.on_shapes(taken.data)
    assert decode_status(again.status()).last_refusal == run.last_refusal


@pytest.mark.parametrize("then", [Removal(1), ObjectDescription(1, Sphere(2.0))], ids=["removed", "described"])
def test_an_object_that_changed_meanwhile_is_left_alone(run, then):
    run.describe(ObjectDescription(1, HEAVY))
    run.describe(then, ObjectDescription(3, dented(3, 1.0)))
    (taken,) = run.wait()
    assert [each.object_id for each in taken.changes] == [3]
    assert run.pipeline.monitor.ids == ([3] if isinstance(then, Removal) else [1, 3])


def test_a_concave_polygon_of_many_corners_is_a_rectangle_first(run):
    turn = np.linspace(0, 2 * np.pi, 300, endpoint=False)
    radius = 1 + 0.3 * (np.arange(300) % 2)
    star = Polygon(np.c_[radius * np.cos(turn), radius * np.sin(turn)])
    run.describe(ObjectDescription(1, star), ObjectDescription(2, Polygon([(0, 0), (1, 0), (0, 1)])))
    (box,) = run.step((1, 0.0), (2, 1.0))
    assert box["model_a"] == Model.AABB
    run.wait()
    (exact,) = run.step((1, 0.0), (2, 1.0))
    assert exact["model_a"] == Model.EXACT
    assert run.replayed() == run.answers


# -- nothing that a message holds may raise


TINY = 5e-324
CUBE = np.array([(x, y, z) for x in (-0.92, 0.92) for y in (-0.92, 0.92) for z in (-0.92, 0.92)])
CUBE[[1, 7], 2] = TINY
FACES = np.array(
    [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]
).reshape(-1, 3)


@pytest.mark.parametrize("model", [model for model in Model if model is not Model.CONVEX_DECOMPOSITION])
@pytest.mark.parametrize("scale", [TINY, 1e-300, 1.0, 1e17])
def test_a_mesh_with_a_denormal_coordinate_does_not_end_the_pipeline(model, scale):
    with np.errstate(all="ignore"):
        corners = CUBE * scale if scale != 1.0 else CUBE
    pipeline = Pipeline("balanced")
    data = encode_descriptions(0, "world", [ObjectDescription(5, Mesh(corners, FACES), model=model), BALL])
    pipeline.on_shapes(data)
    assert 2 in pipeline.monitor.ids
    assert (5 in pipeline.monitor.ids) != bool(sum(pipeline.monitor.refused.values()))
    assert "unexpected" not in pipeline.monitor.last_refusal


@pytest.mark.parametrize(
    "error", [MemoryError(), RecursionError("deep"), OverflowError("large"), np.linalg.LinAlgError("SVD"), IndexError()]
)
def test_an_unexpected_error_refuses_its_object_and_no_other(monkeypatch, error):
    real = roster.monitored_model

    def failing(shapes, model):
        if isinstance(shapes[0][0], Sphere) and shapes[0][0].radius == 3.0:
            raise error
        return real(shapes, model)

    monkeypatch.setattr(roster, "monitored_model", failing)
    pipeline = Pipeline("balanced")
    objects = [BALL, ObjectDescription(5, Sphere(3.0)), ObjectDescription(6, Sphere(1.0))]
    assert len(pipeline.on_shapes(encode_descriptions(0, "world", objects))) == 2
    assert pipeline.monitor.ids == [2, 6]
    assert pipeline.monitor.refused[Refusal.SHAPE] == sum(pipeline.monitor.refused.values()) == 1
    expected = f"object 5: it cannot be monitored, for an unexpected {type(error).__name__}"
    assert expected in pipeline.monitor.last_refusal


def test_an_error_after_the_object_was_added_takes_it_out_again(monkeypatch):
    pipeline = Pipeline("balanced")
    monkeypatch.setattr(pipeline.monitor, "_make_room", lambda: [][0])
    pipeline.on_shapes(encode_descriptions(0, "world", [BALL]))
    assert pipeline.monitor.ids == [] and list(pipeline.catalogue.descriptions) == []
    assert "IndexError" in pipeline.monitor.last_refusal


def test_too_many_shapes_are_refused():
    pipeline = Pipeline("balanced")
    some = [(Sphere(0.1), Pose((0.1 * k, 0, 0))) for k in range(MOST_SHAPES)]
    data = bytearray(encode_descriptions(0, "world", [ObjectDescription(1, some)]))
    assert len(pipeline.on_shapes(bytes(data))) == 1
    with pytest.raises(ValueError, match=f"object 1: expected at most {MOST_SHAPES} shapes"):
        ObjectDescription(1, [*some, some[0]])


def test_many_allowed_pairs_cost_once():
    pipeline = Pipeline("balanced")
    many = ObjectDescription(1, Sphere(1.0), allowed=tuple(range(100, 50_000)))
    others = [ObjectDescription(k, Sphere(1.0), allowed=(k + 1,)) for k in range(2, 300)]
    data = encode_descriptions(0, "world", [many, *others])
    gc.disable()  # it would look at what thousands of other tests hold
    try:
        began = time.process_time()
        pipeline.on_shapes(data)
        assert time.process_time() - began < 1.0  # 10 s, when the pairs were sorted again for each object
    finally:
        gc.enable()


# -- a message of 1 MB


def _random(n: int) -> np.ndarray:
    return np.random.default_rng(1).normal(size=(n, 3))


def _sphere(n: int) -> np.ndarray:
    points = _random(n)
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _soup(points: np.ndarray, faces: int) -> Mesh:
    return Mesh(points, np.random.default_rng(2).integers(0, len(points), (faces, 3)))


def _slivers(n: int) -> Mesh:
    x = np.linspace(0.0, 1.0, n)
    ridge = np.c_[x, 1e-12 * np.sin(1e3 * x), np.zeros(n)]
    k = np.arange(n - 2)
    return Mesh(np.concatenate([ridge, [[0.5, 0.5, 1.0]]]), np.c_[k, k + 1, np.full(n - 2, n)])


def _diagonal(pairs: int) -> Mesh:
    """Slivers in the plane x = y of a cube, which passes through the middles of cells: all determinants vanish."""
    z = np.random.default_rng(3).uniform(0, 24, (pairs, 3))
    corners = np.stack(np.broadcast_arrays(*np.array([(0.0, 24.0, 12.0)] * 2)[..., None, :], z), axis=-1).reshape(-1, 3)
    cube = np.array([(x, y, z) for x in (0, 24.0) for y in (0, 24.0) for z in (0, 24.0)])
    faces = np.arange(3 * pairs).reshape(-1, 3)
    ends = 3 * pairs + np.array([(0, 7, 1), (0, 1, 7), (2, 4, 3), (2, 3, 4)])
    return Mesh(np.concatenate([corners, cube]), np.concatenate([faces, faces[:, ::-1], ends]))


HOSTILE = {
    "30,000 triangles": lambda: [_soup(_sphere(15_000), 30_000)],
    "a convex mesh of 20,480 triangles": lambda: [dented(5)],
    "random triangles": lambda: [_soup(_random(1000), 60_000)],
    "slivers": lambda: [_slivers(25_000)],
    "points in one place": lambda: [_soup(np.zeros((20_000, 3)), 40_000)],
    "a hull of points in one place and four others": lambda: [
        ConvexHull(np.concatenate([np.zeros((40_000, 3)), np.eye(3), -np.eye(3)]))
    ],
    "a hull of duplicates": lambda: [ConvexHull(np.repeat(_random(100), 400, axis=0))],
    "a hull of points on a sphere": lambda: [ConvexHull(_sphere(40_000))],
    "a hull of a grid": lambda: [ConvexHull(np.stack(np.meshgrid(*[np.arange(34.0)] * 3), -1).reshape(-1, 3))],
    "20 meshes of 1,280 triangles": lambda: [dented(3, k) for k in range(20)],
    "tiny meshes": lambda: [Mesh(dented(2, k).vertices * 1e-200, dented(2).faces) for k in range(60)],
    "thin meshes": lambda: [Mesh(dented(2, k).vertices * (1.0, 1.0, 1e-15), dented(2).faces) for k in range(60)],
    "slivers in a plane through the cells": lambda: [_diagonal(350) for _ in range(10)],
    "a polygon of 40,000 corners": lambda: [Polygon(_random(40_000)[:, :2])],
}


@pytest.mark.parametrize("make", HOSTILE.values(), ids=HOSTILE)
def test_one_megabyte_holds_the_thread_for_a_tenth_of_a_second(run, make):
    run.describe(*([] if isinstance((shapes := make())[0], Polygon) else [BALL]))
    model = Model.SPHERE if isinstance(shapes[0], Mesh) else Model.AUTO  # any mesh has a bounding sphere
    objects = [ObjectDescription(10 + k, shape, model=model) for k, shape in enumerate(shapes)]
    data = encode_descriptions(1, "world", objects)
    assert 0.2e6 < len(data) < 1.2e6
    times = []
    for _ in range(2):  # the first one imports SciPy's modules
        began = time.thread_time()
        run.pipeline.take_shapes(data)
        times.append(time.thread_time() - began)
    assert min(times) < NOISE * LIMIT, f"{min(times) * 1e3:.0f} ms"
    print(f"{min(times) * 1e3:.0f} ms, refused: {run.last_refusal!r:.80}")


def test_a_half_space_with_a_heavy_mesh_is_refused_with_a_text(run):
    both = [(HEAVY, Pose()), (HalfSpace((0, 0, 1)), Pose())]
    run.describe(ObjectDescription(1, both, static=True, pose=Pose(), model=Model.CONVEX_HULL), BALL)
    assert run.pipeline.monitor.ids == [2]
    assert "supported are auto, exact" in run.last_refusal
