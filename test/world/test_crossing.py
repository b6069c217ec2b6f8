"""Tests of the crossing scene's contact times against sampling and bisection.

The oracle is independent of the scene's closed forms and of the package's kernels: it moves the objects by their
published twists and computes point-to-box distances, separating axes and a search along the capsule's core.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from collision_monitor.records import StateFlag
from collision_monitor.shapes.registry import Box, Capsule, Sphere
from collision_monitor.world import make_scene

SCENE = make_scene("crossing")
DESCRIBED = {d.object_id: d for d in SCENE.descriptions}
START = {int(s["id"]): s for s in SCENE.states()}


def pose(object_id, t):
    """Position and rotation matrix after t seconds at the twist of t = 0."""
    if DESCRIBED[object_id].static:
        where = DESCRIBED[object_id].pose
        return where.position, where.rotation
    state = START[object_id]
    turned = Rotation.from_rotvec(state["angular"] * t) * Rotation.from_quat(state["quaternion"])
    return state["position"] + state["linear"] * t, turned.as_matrix()


def point_to_box(point, box, at, rotation):
    local = np.abs(rotation.T @ (point - at)) - np.array(box.size) / 2
    return np.linalg.norm(np.maximum(local, 0.0))


def boxes_touch(a, pose_a, b, pose_b):
    (at_a, rotation_a), (at_b, rotation_b) = pose_a, pose_b
    crossed = np.cross(rotation_a.T[:, None], rotation_b.T[None, :]).reshape(-1, 3)
    for axis in np.concatenate([rotation_a.T, rotation_b.T, crossed]):
        if np.linalg.norm(axis) < 1e-9:
            continue
        reach = np.abs(axis @ rotation_a) @ np.array(a.size) / 2 + np.abs(axis @ rotation_b) @ np.array(b.size) / 2
        if abs(axis @ (at_b - at_a)) > reach:
            return False
    return True


def capsule_to_box(capsule, pose_a, box, pose_b):
    """Distance by ternary search, as the distance along the core is convex."""
    at, axis = pose_a[0], pose_a[1][:, 2]
    low, high = -capsule.length / 2, capsule.length / 2
    for _ in range(100):
        one, two = low + (high - low) / 3, high - (high - low) / 3
        if point_to_box(at + one * axis, box, *pose_b) < point_to_box(at + two * axis, box, *pose_b):
            high = two
        else:
            low = one
    return point_to_box(at + low * axis, box, *pose_b)


def touch(id_a, id_b, t):
    (shape_a, _), (shape_b, _) = DESCRIBED[id_a].shapes[0], DESCRIBED[id_b].shapes[0]
    pose_a, pose_b = pose(id_a, t), pose(id_b, t)
    match shape_a, shape_b:
        case Sphere(), Sphere():
            return np.linalg.norm(pose_a[0] - pose_b[0]) <= shape_a.radius + shape_b.radius
        case Sphere(), Box():
            return point_to_box(pose_a[0], shape_b, *pose_b) <= shape_a.radius
        case Box(), Sphere():
            return point_to_box(pose_b[0], shape_a, *pose_a) <= shape_b.radius
        case Box(), Box():
            return boxes_touch(shape_a, pose_a, shape_b, pose_b)
        case Capsule(), Box():
            return capsule_to_box(shape_a, pose_a, shape_b, pose_b) <= shape_a.radius
    raise AssertionError(f"no oracle for {shape_a} and {shape_b}")


def changes(id_a, id_b):
    """Times at which contact begins or ends, by samples of 10 ms and bisection."""
    times = np.arange(0.0, SCENE.period, 0.01)
    states = [touch(id_a, id_b, t) for t in times]
    found = []
    for k in range(1, len(times)):
        if states[k] != states[k - 1]:
            low, high = times[k - 1], times[k]
            for _ in range(50):
                middle = (low + high) / 2
                low, high = (middle, high) if touch(id_a, id_b, middle) == states[k - 1] else (low, middle)
            found.append(high)
    return found


@pytest.mark.parametrize("encounter", SCENE.expected, ids=lambda e: DESCRIBED[e.id_a].name)
def test_contact_begins_and_ends_when_the_scene_says(encounter):
    expected = [t for t in (encounter.begin, encounter.end) if t is not None]
    assert changes(encounter.id_a, encounter.id_b) == pytest.approx(expected, abs=1e-9)


def test_there_are_hits_and_near_misses():
    hits = [e for e in SCENE.expected if e.begin is not None]
    assert (len(hits), len(SCENE.expected)) == (7, 9)
    assert all(0.0 < e.begin < e.end < SCENE.period for e in hits)


def test_every_object_is_in_one_encounter_and_lanes_stay_apart():
    mentioned = [i for e in SCENE.expected for i in (e.id_a, e.id_b)]
    assert sorted(mentioned) == sorted(DESCRIBED)
    lane = {i: k for k, e in enumerate(SCENE.expected) for i in (e.id_a, e.id_b)}

    def reach(object_id):
        match DESCRIBED[object_id].shapes[0][0]:
            case Sphere(radius):
                return radius
            case Capsule(radius, length):
                return radius + length / 2
            case Box(size):
                return float(np.linalg.norm(size)) / 2

    for t in np.arange(0.0, SCENE.period, 0.05):
        at = {i: pose(i, t)[0] for i in DESCRIBED}
        for a in DESCRIBED:
            for b in DESCRIBED:
                if lane[a] < lane[b]:
                    assert np.linalg.norm(at[a] - at[b]) > reach(a) + reach(b)


def test_the_scene_moves_as_its_twists_say_and_starts_again_with_a_flag():
    scene = make_scene("crossing")
    first = scene.states()
    for _ in range(15):
        states = scene.step(0.5)
        assert not states["flags"].any()
        for state in states:
            position, rotation = pose(int(state["id"]), scene.time)
            assert state["position"] == pytest.approx(position, abs=1e-12)
            assert Rotation.from_quat(state["quaternion"]).as_matrix() == pytest.approx(rotation, abs=1e-12)
    again = scene.step(0.5)
    assert (again["flags"] == StateFlag.DISCONTINUITY).all()
    assert again["position"] == pytest.approx(first["position"])
    assert not scene.step(0.5)["flags"].any()
