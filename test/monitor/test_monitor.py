"""The whole monitor: against plain recomputation, against a test of every pair, and with invalid inputs."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.accuracy.reference_monitor import ReferenceMonitor, disagreements
from collision_monitor.errors import InputError, PoseError, Refusal, ShapeError, UnsupportedError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose, from_rotation_vector, multiply, rotation_matrix
from collision_monitor.shapes.registry import Box, Capsule, Circle, HalfSpace, Shape, Sphere
from collision_monitor.world import make_scene

SECOND = 1_000_000_000


def pair(record: np.void) -> tuple[int, int]:
    return int(record["id_a"]), int(record["id_b"])


def touching(result: StepResult) -> set[tuple[int, int]]:
    return {pair(c) for c in result.contacts if c["phase"] != records.Phase.END}


def assert_sorted(result: StepResult) -> None:
    contacts = [(*pair(c), int(c["point_index"])) for c in result.contacts]
    assert contacts == sorted(contacts)
    predictions = [(float(p["lower"]), *pair(p)) for p in result.predictions]
    assert predictions == sorted(predictions)
    assert all(a < b for a, b in map(pair, (*result.contacts, *result.predictions)))


class Swarm:
    """Boxes, spheres, capsules and compounds that move in a box of space, with noise and course changes."""

    def __init__(self, n: int, seed: int) -> None:
        self.rng = rng = np.random.default_rng(seed)
        self.n = n
        side = (n / 0.25) ** (1 / 3)
        self.position = rng.uniform(0, side, (n, 3))
        q = rng.normal(0, 1, (n, 4))
        self.quaternion = q / np.linalg.norm(q, axis=1, keepdims=True)
        self.linear = rng.uniform(-1, 1, (n, 3))
        self.angular = rng.uniform(-1, 1, (n, 3))
        self.side = side

    def describe(self, monitor: Monitor) -> None:
        rng = np.random.default_rng(99)
        for i in range(self.n):
            kind = i % 4
            if kind == 0:
                monitor.add(i, Box(rng.uniform(0.2, 1.0, 3)))
            elif kind == 1:
                monitor.add(i, Sphere(rng.uniform(0.2, 0.5)))
            elif kind == 2:
                monitor.add(i, Capsule(0.2, 0.6), padding=0.05)
            else:
                monitor.add(i, [(Box((0.5, 0.3, 0.2)), Pose((0.3, 0, 0))), (Sphere(0.2), Pose((-0.3, 0.1, 0)))])
        monitor.add(self.n, Box((self.side, self.side, 0.2)), static=True, pose=Pose((self.side / 2, self.side / 2, 0)))
        monitor.add(self.n + 1, HalfSpace((1, 0, 0), 0.3), static=True, pose=Pose())

    def move(self, dt: float, turn: float = 0.0) -> None:
        self.position += self.linear * dt
        self.quaternion = multiply(from_rotation_vector(self.angular * dt), self.quaternion)
        out = (self.position < 0) & (self.linear < 0) | (self.position > self.side) & (self.linear > 0)
        self.linear[out] *= -1
        changed = self.rng.random(self.n) < turn
        self.linear[changed] = self.rng.uniform(-1, 1, (int(changed.sum()), 3))
        self.angular[changed] = self.rng.uniform(-1, 1, (int(changed.sum()), 3))

    def states(self, noise: float = 0.0, keep: float = 1.0) -> NDArray[np.void]:
        states = np.zeros(self.n, records.STATE)
        states["id"] = np.arange(self.n)
        shake = lambda: noise * self.rng.uniform(-1, 1, (self.n, 3)) / np.sqrt(3)  # noqa: E731
        states["position"] = self.position + shake()
        states["quaternion"] = multiply(from_rotation_vector(shake()), self.quaternion)
        states["linear"] = self.linear + shake()
        states["angular"] = self.angular + shake()
        return states[self.rng.random(self.n) < keep]


@pytest.mark.parametrize(
    ("noise", "turn", "keep"),
    [(0.0, 0.0, 1.0), (0.0, 0.05, 1.0), (4e-4, 0.0, 1.0), (0.0, 1.0, 1.0), (3e-4, 0.02, 0.6)],
    ids=["steady", "some turn", "noise", "all jump", "noise, turns and gaps"],
)
def test_the_event_list_equals_plain_recomputation(noise: float, turn: float, keep: float) -> None:
    swarm = Swarm(60, seed=3)
    profile = Profile.named("balanced").replace(stale_acceleration=0.0)
    mine, plain = Monitor(profile), ReferenceMonitor(profile)
    for monitor in (mine, plain):
        swarm.describe(monitor)
    moved = seen = 0
    for step in range(150):
        states = swarm.states(noise, keep)
        a, b = mine.step(step * SECOND // 50, states), plain.step(step * SECOND // 50, states)
        assert_sorted(a)
        assert disagreements(a, b, profile.horizon) == []
        seen += len(b.predictions) + len(b.contacts)
        moved += a.status.objects_moved
        swarm.move(0.02, turn)
    assert seen > 500
    if turn == 0.0:
        assert moved < 60 * 150 / 10


@pytest.mark.parametrize("shapes", [(Sphere(0.5), Sphere(0.5)), (Box((1, 1, 1)), Capsule(0.5, 1.0))])
def test_a_motion_that_is_kept_is_continued_not_started_anew(shapes: tuple[Shape, Shape]) -> None:
    """A pair starts 14 m apart and passes through itself: one answer a step, certain in time, no new prediction."""
    monitor, rate, speed = Monitor(), 10, 1.0
    for object_id, shape in enumerate(shapes):
        monitor.add(object_id, shape)
    twists = np.zeros((2, 6))
    twists[:, 0] = speed, -speed
    reported: list[float] = []
    touched = queries = 0
    for step in range(12 * rate):
        t = step / rate
        result = monitor.step(step * SECOND // rate, [0, 1], still(speed * t, 14 - speed * t), twists)
        assert result.status.objects_moved == (2 if step == 0 else 0)
        assert len(result.predictions) + len(result.contacts) <= 1
        for prediction in result.predictions:
            reported.append(t + prediction["lower"])
            certain = prediction["status"] == records.PredictionStatus.HIT
            assert certain or prediction["lower"] > 1.8  # near the horizon it may still be uncertain
            assert prediction["lower"] <= 6.5 - t <= prediction["upper"] or prediction["lower"] == 0.0
        touched += len(touching(result))
        queries += result.status.impact_queries
    assert len(reported) >= 18
    assert max(reported) - min(reported) < 0.01
    assert touched >= 10
    assert queries < 60


@pytest.mark.parametrize("shape", [Sphere(0.5), Box((1, 1, 1))])
def test_a_pair_is_reported_once_after_a_pause_longer_than_what_was_predicted(shape: Shape) -> None:
    """A pair keeps its motion, and its next update comes when it touches and its prediction has expired."""
    monitor, speed = Monitor(), 0.4
    monitor.add(0, shape)
    monitor.add(1, shape)
    twists = np.zeros((2, 6))
    twists[:, 0] = speed, -speed
    phases = []
    for t in (0.0, 3.4, 3.5):
        result = monitor.step(int(t * SECOND), [0, 1], still(speed * t, 2.0 - speed * t), twists)
        phases.append(result.contacts["phase"].tolist())
    assert phases == [[], [records.Phase.BEGIN], [records.Phase.PERSIST]]


def test_disagreements_are_noticed() -> None:
    result = Monitor().step(0, [], np.zeros((0, 7)))
    one = Monitor()
    one.add(1, Sphere(0.5))
    one.add(2, Sphere(0.5))
    collides = one.step(0, [1, 2], still(0, 2), [[1, 0, 0, 0, 0, 0], [0] * 6])
    assert ["missed" in text for text in disagreements(result, collides, 2.0)] == [True]
    assert ["never" in text for text in disagreements(collides, result, 2.0)] == [True]
    touches = one.step(1, [1, 2], still(0, 0.9))
    assert ["one answer only" in text for text in disagreements(touches, result, 2.0)] == [True]
    late = dataclasses.replace(collides, predictions=collides.predictions.copy())
    late.predictions["lower"] += 0.5
    late.predictions["upper"] += 0.5
    assert ["collides in" in text for text in disagreements(late, collides, 2.0)] == [True]


def test_contacts_are_those_of_looking_at_every_pair() -> None:
    swarm = Swarm(48, seed=5)
    monitor = Monitor(Profile.named("fast").replace(distance_tolerance=0.0))
    swarm.describe(monitor)
    table, parts, bodies = monitor._roster.multibody
    owner = {}
    for i in range(swarm.n):
        slot = int(bodies.first_shape[i])
        while slot >= 0:
            owner[slot] = i
            slot = int(parts.next[slot])
    slots = sorted(owner)
    pairs = np.array([p for p in itertools.combinations(slots, 2) if owner[p[0]] != owner[p[1]]], np.int32)
    found = 0
    for step in range(60):
        result = monitor.step(step * SECOND // 20, swarm.states())
        rotation = np.zeros((len(table.kind), 3, 3))
        position = np.zeros((len(table.kind), 3))
        R = rotation_matrix(swarm.quaternion)
        for slot in slots:
            i = owner[slot]
            position[slot] = swarm.position[i] + R[i] @ table.local_position[slot]
            rotation[slot] = R[i] @ table.local_rotation[slot]
        deepest: dict[tuple[int, int], float] = {}
        for (a, b), contact in zip(pairs, contact_batch(table, position, rotation, pairs), strict=True):
            if contact[0] <= 0.0:
                key = tuple(sorted((owner[a], owner[b])))
                deepest[key] = min(contact[0], deepest.get(key, 0.0))
        mine = {pair(c): c for c in result.contacts if c["phase"] != records.Phase.END and pair(c)[1] < swarm.n}
        assert mine.keys() == deepest.keys()
        for key, c in mine.items():
            assert c["signed_distance"] == pytest.approx(deepest[key], abs=1e-12)
            apart = c["point_b"] - c["point_a"]
            assert np.allclose(apart, c["signed_distance"] * c["normal"], atol=1e-9)
        found += len(mine)
        swarm.move(0.05)
    assert found > 100


def test_contacts_begin_persist_and_end_once() -> None:
    monitor = Monitor()
    monitor.add(1, Sphere(0.5))
    monitor.add(2, Sphere(0.5))
    phases: list[int] = []
    durations: list[float] = []
    for step in range(60):
        x = -1.5 + 0.05 * step
        poses = [[x, 0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0, 1]]
        result = monitor.step(step * SECOND // 20, [1, 2], poses, [[1, 0, 0, 0, 0, 0], [0] * 6])
        for contact in result.contact_rows:
            phases.append(int(contact["phase"]))
            durations.append(float(contact["duration"]))
        assert not (len(result.contact_rows) and len(result.predictions))
    assert phases == [records.Phase.BEGIN, *[records.Phase.PERSIST] * (len(phases) - 2), records.Phase.END]
    assert np.allclose(durations, np.arange(len(phases)) * 0.05)
    assert len(phases) == 42  # touching from x = -1 to x = 1, both included, and the END


def test_crossing_happens_when_it_must() -> None:
    scene = make_scene("crossing")
    monitor = Monitor("exact")
    for description in scene.descriptions:
        monitor.describe(description)
    begins: dict[tuple[int, int], float] = {}
    first_seen: dict[tuple[int, int], tuple[float, float]] = {}
    while scene.time < 6.0:
        result = monitor.step(round(scene.time * SECOND), scene.states())
        for p in result.predictions:
            if p["status"] == records.PredictionStatus.HIT:
                first_seen.setdefault(pair(p), (scene.time + p["lower"], scene.time + p["upper"]))
        for c in result.contacts:
            if c["phase"] == records.Phase.BEGIN:
                begins.setdefault(pair(c), scene.time)
        scene.step()
    for encounter in scene.expected:
        key = min(encounter.id_a, encounter.id_b), max(encounter.id_a, encounter.id_b)
        if encounter.begin is None:
            assert key not in first_seen and key not in begins, encounter.derivation
        elif encounter.begin < 6.0:
            lower, upper = first_seen[key]
            assert lower <= encounter.begin + 1e-9 and encounter.begin <= upper + 1e-9, encounter.derivation
            assert upper - lower < 1e-4
            assert encounter.begin <= begins[key] < encounter.begin + 1.0 / scene.rate + 1e-9


def still(*positions: float) -> NDArray[np.float64]:
    poses = np.zeros((len(positions), 7))
    poses[:, 0], poses[:, 6] = positions, 1.0
    return poses


class TestRefusals:
    @pytest.fixture
    def monitor(self) -> Monitor:
        monitor = Monitor()
        for object_id in (1, 2, 3):
            monitor.add(object_id, Sphere(0.5))
        monitor.step(0, [1, 2, 3], still(0, 0.9, 5))
        return monitor

    @pytest.mark.parametrize(
        ("row", "reason"),
        [
            ([np.nan, 0, 0, 0, 0, 0, 1], Refusal.NON_FINITE),
            ([0, np.inf, 0, 0, 0, 0, 1], Refusal.NON_FINITE),
            ([1e300, 0, 0, 0, 0, 0, 1], Refusal.NON_FINITE),
            ([0, 0, 0, 0, 0, 0, 0], Refusal.QUATERNION),
            ([0, 0, 0, 1, 1, 1, 1], Refusal.QUATERNION),
            ([0, 0, 0, 0, 0, 0, np.nan], Refusal.NON_FINITE),
        ],
    )
    def test_a_bad_state_is_counted_and_the_others_go_on(
        self, monitor: Monitor, row: list[float], reason: Refusal
    ) -> None:
        poses = still(0, 0.9, 5)
        poses[2] = row
        result = monitor.step(SECOND // 10, [1, 2, 3], poses)
        assert monitor.refused[reason] == 1 and sum(monitor.refused.values()) == 1
        assert "object 3" in monitor.last_refusal
        assert touching(result) == {(1, 2)}
        assert np.isfinite(result.contacts["signed_distance"]).all()

    def test_a_negative_standard_deviation_is_refused_and_an_unknown_one_is_not(self, monitor: Monitor) -> None:
        states = np.zeros(2, records.STATE)
        states["id"], states["quaternion"][:, 3] = (1, 2), 1.0
        states["position_stddev"] = -1.0, np.nan
        monitor.step(SECOND // 10, states)
        assert monitor.refused[Refusal.NON_FINITE] == 1 and "object 1" in monitor.last_refusal

    def test_unknown_removed_and_old(self, monitor: Monitor) -> None:
        monitor.remove(3)
        result = monitor.step(SECOND // 10, [1, 2, 3, 77], still(0, 0.9, 5, 5))
        assert monitor.refused[Refusal.UNKNOWN_ID] == 2
        assert touching(result) == {(1, 2)}
        monitor.step(SECOND // 20, [1, 2], still(8, 9))
        assert monitor.refused[Refusal.OLD] == 2
        result = monitor.step(SECOND // 5, [1, 1], still(3, 9))
        assert monitor.refused[Refusal.OLD] == 3  # one id twice: the first counts
        assert touching(result) == set()

    def test_a_stamp_that_jumps_is_refused_until_it_is_confirmed(self, monitor: Monitor) -> None:
        far = 2**63 - 1
        result = monitor.step(far, [1, 2], still(0, 9))
        assert not result.accepted and monitor.refused[Refusal.TIME] == 1
        result = monitor.step(SECOND // 10, [1, 2], still(0, 0.8))
        assert result.accepted and touching(result) == {(1, 2)}
        monitor.step(-50 * SECOND, [1, 2], still(0, 0.9))
        result = monitor.step(-49 * SECOND, [1, 2], still(0, 9))
        assert result.accepted and result.stamp_ns == -49 * SECOND
        assert len(result.ended) == 1 and not len(result.contacts)
        assert result.status.objects_unseen == 1

    def test_arrays_of_another_shape_raise(self, monitor: Monitor) -> None:
        with pytest.raises(InputError, match=r"poses \(N, 7\)"):
            monitor.step(1, [1, 2], still(0))
        with pytest.raises(InputError, match="numbers"):
            monitor.step(1, [1], [["a"] * 7])
        with pytest.raises(InputError, match="ids"):
            monitor.step(1, [-1], still(0))
        with pytest.raises(InputError, match="described"):
            monitor.remove(99)

    @pytest.mark.parametrize("stamp", [0.1, "0", None, float("nan"), True])
    def test_a_stamp_is_an_integer(self, monitor: Monitor, stamp: object) -> None:
        with pytest.raises(InputError, match="nanoseconds"):
            monitor.step(stamp, [1], still(0))  # type: ignore[arg-type]

    def test_a_step_without_states_is_a_step(self, monitor: Monitor) -> None:
        assert touching(monitor.step(SECOND // 100, [])) == {(1, 2)}
        assert touching(monitor.step(SECOND // 50, [], [], [])) == {(1, 2)}

    def test_the_end_of_a_contact_comes_before_its_new_beginning(self, monitor: Monitor) -> None:
        monitor.remove(1)
        monitor.add(1, Sphere(0.5))
        result = monitor.step(SECOND // 100, [1, 2], still(0, 0.9))
        assert [int(c["phase"]) for c in result.contact_rows] == [records.Phase.END, records.Phase.BEGIN]

    @pytest.mark.parametrize("big", [1e200, np.inf])
    def test_what_is_too_large_to_compute_with_is_refused(self, monitor: Monitor, big: float) -> None:
        for make in (lambda: Sphere(big), lambda: Box((big, 1, 1)), lambda: Capsule(1, big)):
            with pytest.raises(ShapeError, match=r"1e\+18"):
                make()
        with pytest.raises(PoseError, match=r"1e\+18"):
            Pose((big, 0, 0))

    def test_bad_descriptions_change_nothing(self, monitor: Monitor) -> None:
        with pytest.raises(ShapeError):
            monitor.add(1, Sphere(-1))
        with pytest.raises(UnsupportedError, match="Circle"):
            monitor.add(1, [(Sphere(1), Pose()), (Circle(1), Pose())], replace=True)
        with pytest.raises(UnsupportedError, match="static"):
            monitor.add(4, HalfSpace((0, 0, 1)))
        with pytest.raises(UnsupportedError, match="scene in the plane"):
            monitor.add(4, Circle(1))
        assert monitor.ids == [1, 2, 3] and len(monitor._roster._shapes) == 3
        assert touching(monitor.step(SECOND // 10, [1, 2], still(0, 0.9))) == {(1, 2)}


def test_an_object_without_updates_is_never_clear() -> None:
    monitor = Monitor(Profile(stale_after=0.35, stale_acceleration=2.0))
    monitor.add(1, Sphere(0.5))
    monitor.add(2, Sphere(0.5))
    monitor.step(0, [1, 2], still(0, 2.0))
    statuses = []
    for step in range(1, 20):
        result = monitor.step(step * SECOND // 10, [1], still(0))
        assert result.status.objects_stale == (1 if step > 3 else 0)
        statuses.append([int(c["status"]) for c in result.contacts])
    # an acceleration of 2 m/s^2 can close a gap of 1 m after 1 s
    assert statuses[:9] == [[]] * 9
    assert statuses[10:] == [[records.ContactStatus.UNRESOLVED]] * 9
    assert result.contacts[0]["error_bound"] >= 0.5 * 2.0 * 1.9**2


def test_masks_allowed_pairs_and_new_descriptions() -> None:
    monitor = Monitor()
    monitor.add(1, Sphere(0.5), group=1, mask=2)
    monitor.add(2, Sphere(0.5), group=2)
    monitor.add(3, Sphere(0.5), group=4, allowed=(2,))
    poses = still(0, 0.1, 0.2)
    assert touching(monitor.step(0, [1, 2, 3], poses)) == {(1, 2)}
    monitor.add(3, Sphere(0.5), group=4, replace=True)
    assert touching(monitor.step(1, [1, 2, 3], poses)) == {(1, 2), (2, 3)}
    monitor.add(1, Sphere(0.01), group=1, replace=True)
    poses[0, 0] = 2.0
    assert touching(monitor.step(2, [1, 2, 3], poses)) == {(2, 3)}
    monitor.add(1, Sphere(1.9), group=1, replace=True)
    assert touching(monitor.step(3, [1, 2, 3], poses)) == {(1, 2), (1, 3), (2, 3)}
    monitor.remove(2)
    result = monitor.step(4, [1, 3], poses[[0, 2]])
    assert touching(result) == {(1, 3)}
    ended = list(result.ended)
    assert [pair(c) for c in ended] == [(1, 2), (2, 3)] and np.isnan(ended[0]["signed_distance"])


def test_a_new_description_ends_what_it_no_longer_allows_to_be_said() -> None:
    monitor = Monitor()
    for object_id in (1, 2):
        monitor.add(object_id, Sphere(0.5))
    monitor.add(3, Sphere(0.5), static=True, pose=Pose((3.5, 0, 0)))
    moving = [[1, 0, 0, 0, 0, 0]] * 2
    result = monitor.step(0, [1, 2], still(0, 0.9), moving)
    assert touching(result) == {(1, 2)} and [pair(p) for p in result.predictions] == [(2, 3)]
    monitor.add(1, Sphere(0.5), allowed=(2,), replace=True)
    result = monitor.step(SECOND // 100, [1, 2], still(0.01, 0.91), moving)
    assert [pair(c) for c in result.ended] == [(1, 2)] and not len(result.contacts)
    assert len(monitor.step(SECOND // 50, [1, 2], still(0.02, 0.92), moving).contacts) == 0
    # a static object that becomes a moving one has no state: its old place gives no answers
    monitor.add(3, Sphere(0.5), replace=True)
    result = monitor.step(SECOND // 20, [1, 2], still(0.05, 0.95), moving)
    assert result.status.objects_unseen == 1 and len(result.predictions) == 0
    monitor.add(1, Sphere(0.5), group=2, mask=4, replace=True)
    assert touching(monitor.step(SECOND // 10, [1, 2], still(0.1, 1.0), moving)) == set()
    monitor.add(1, Sphere(0.5), replace=True)
    result = monitor.step(SECOND // 5, [1, 2, 3], still(0.2, 1.1, 1.2), [*moving, [0] * 6])
    assert touching(result) == {(1, 2), (1, 3), (2, 3)}
    assert {int(c["phase"]) for c in result.contacts} == {records.Phase.BEGIN}
    # only another shape: the contact persists without a new BEGIN
    monitor.add(3, Box((0.1, 0.1, 0.1)), replace=True)
    result = monitor.step(SECOND // 4, [1, 2, 3], still(0.25, 1.15, 0.7), [*moving, [0] * 6])
    assert {pair(c): int(c["phase"]) for c in result.contacts}[(2, 3)] == records.Phase.PERSIST


def test_objects_come_and_go_without_a_trace() -> None:
    rng = np.random.default_rng(0)
    monitor = Monitor()
    for step in range(300):
        for object_id in rng.integers(0, 40, 3).tolist():
            if object_id in monitor.ids:
                monitor.remove(object_id)
            else:
                monitor.add(object_id, Box(rng.uniform(0.2, 1, 3)) if object_id % 2 else Sphere(0.4))
        ids = monitor.ids
        poses = np.zeros((len(ids), 7))
        poses[:, :3] = np.random.default_rng(7).uniform(0, 3, (40, 3))[ids]
        poses[:, 6] = 1.0
        result = monitor.step(step * SECOND // 100, ids, poses)
        fresh = Monitor()
        for object_id in ids:
            fresh.describe(described := monitor_description(monitor, object_id))
            assert described.object_id == object_id
        assert touching(result) == touching(fresh.step(0, ids, poses))
    assert monitor._roster.top <= 40 and len(monitor._roster._shapes) == len(monitor.ids)


def monitor_description(monitor: Monitor, object_id: int):  # type: ignore[no-untyped-def]
    from collision_monitor.objects.description import ObjectDescription

    table, _, bodies = monitor._roster.multibody
    slot = int(bodies.first_shape[monitor._roster.slot(object_id)])
    if table.kind[slot] == records.ShapeType.SPHERE:
        return ObjectDescription(object_id, Sphere(float(table.size[slot, 0])))
    return ObjectDescription(object_id, Box(2 * table.size[slot, :3]))


def test_the_same_inputs_give_the_same_bytes() -> None:
    digests = set()
    for _ in range(2):
        swarm, monitor = Swarm(40, seed=11), Monitor()
        swarm.describe(monitor)
        for step in range(50):
            result = monitor.step(step * SECOND // 50, swarm.states(1e-3))
            swarm.move(0.02, 0.02)
        digests.add((monitor.digest, result.contacts.tobytes(), result.predictions.tobytes()))
    assert len(digests) == 1
    monitor.step(step * SECOND // 50 + 1, swarm.states())
    assert monitor.digest not in {d[0] for d in digests}


def test_the_predictions_of_bodies_that_start_together_do_not_end_together() -> None:
    """All objects are described at once, but the extension of their predictions is spread over the steps."""
    rng = np.random.default_rng(5)
    monitor, n, rate = Monitor(), 400, 50
    for object_id in range(n):
        monitor.add(object_id, Sphere(0.2))
    poses, twists = np.zeros((n, 7)), np.zeros((n, 6))
    poses[:, :3], poses[:, 6] = rng.uniform(0, 20, (n, 3)), 1.0
    twists[:, :3] = rng.uniform(-1, 1, (n, 3))
    looked_up = []
    for step in range(6 * rate):
        looked_up.append(monitor.step(step * SECOND // rate, np.arange(n), poses, twists).status.candidate_pairs)
        poses[:, :3] += twists[:, :3] / rate
    assert looked_up[0] > 200
    assert max(looked_up[1:]) < looked_up[0] / 10


@pytest.mark.parametrize("flags", [0, records.StateFlag.TWIST_UNKNOWN])
def test_states_that_are_handed_over_stay_as_they_are(flags: int) -> None:
    """The caller's array does not change; estimated twists and their errors go into a copy."""
    swarm, mine, copied = Swarm(20, seed=5), Monitor(), Monitor()
    swarm.describe(mine)
    swarm.describe(copied)
    for step in range(5):
        states = swarm.states()
        states["flags"], states["position_stddev"] = flags, 0.01
        before = states.copy()
        answer = mine.step(step * SECOND // 50, states)
        assert states.tobytes() == before.tobytes()
        before.flags.writeable = False
        other = copied.step(step * SECOND // 50, before)
        assert answer.contacts.tobytes() == other.contacts.tobytes()
        assert answer.predictions.tobytes() == other.predictions.tobytes()
        swarm.move(0.02)


def test_covariances_leave_the_callers_states_as_they_are() -> None:
    """They replace the standard deviations of the states in a copy."""
    swarm, monitor = Swarm(20, seed=5), Monitor()
    swarm.describe(monitor)
    states = swarm.states()
    states["position_stddev"] = 0.25
    before = states.tobytes()
    with_covariance = monitor.step(0, states, covariance=np.tile([4.0, 0, 0, 4.0, 0, 4.0], (20, 2)))
    assert states.tobytes() == before
    assert with_covariance.predictions["probability"].max() > 0.0, "the covariances count"
