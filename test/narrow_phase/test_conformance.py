"""Cases from the test suites of FCL, libccd and parry, if their folder lies beside the repository."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from minkowski import rotation
from pairs import contact, size

import collision_monitor as cm
from collision_monitor.shapes.pose import rotation_matrix
from collision_monitor.shapes.registry import Box, Capsule, Cone, Cylinder, Ellipsoid, HalfSpace, Sphere

CASES = Path(__file__).parents[3] / "shared" / "conformance" / "cases.json"

OTHER_NORMAL = {
    8,  # a box in the middle of a box: +x and -x are equally near
    22,  # cones side by side: the way out across the slant (0.0894) is shorter than the expected one along x (0.1)
    26,  # a cylinder beside a cone: the same
}

pytestmark = pytest.mark.skipif(not CASES.exists(), reason="the conformance cases are not here")


def shape(record):
    match record["type"]:
        case "sphere":
            return Sphere(record["radius"])
        case "box":
            return Box(record["size"])
        case "capsule" | "cylinder" | "cone" as kind:
            assert record.get("axis", "z") == "z"
            return {"capsule": Capsule, "cylinder": Cylinder, "cone": Cone}[kind](record["radius"], record["length"])
        case "ellipsoid":
            return Ellipsoid(record["radii"])
        case "halfspace":
            return HalfSpace(record["normal"], record["offset"])
    return None


def pose(record):
    R = np.array(record["rot"], float).reshape(3, 3) if "rot" in record else rotation_matrix(record["quat"])
    return np.array(record["pos"], float), R


def supported():
    if not CASES.exists():
        return []
    cases = json.loads(CASES.read_text())["cases"]
    return [
        c for c in cases if c["dim"] == 3 and shape(c["shapeA"]) and shape(c["shapeB"]) and "toi" not in c["expected"]
    ]


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("case", supported(), ids=lambda c: str(c["id"]))
def test_case(case, swap, moved):
    a, b = shape(case["shapeA"]), shape(case["shapeB"])
    (p_A, R_A), (p_B, R_B) = pose(case["poseA"]), pose(case["poseB"])
    expected = case["expected"]
    R = rotation(np.random.default_rng(case["id"])) if moved else np.eye(3)
    c = contact(a, b, R @ (p_B - p_A), R @ R_A, R @ R_B, swap=swap)
    n, sign = R.T @ c.normal, -1.0 if swap else 1.0
    tolerance = case["tolerance"] or 1e-9
    round_off = 1e-14 * (size(a) + size(b) + np.abs(p_B - p_A).max()) + c.bound
    if "collide" in expected:
        if expected["collide"]:
            assert c.distance <= round_off
        else:
            assert c.distance >= -round_off
    for key, sense in (("distance", 1.0), ("signed_distance", 1.0), ("depth", -1.0)):
        if expected.get(key) is not None and (key != "distance" or expected[key] >= 0):
            assert sense * c.distance == pytest.approx(expected[key], abs=max(tolerance, round_off), rel=1e-9)
    if expected.get("normal") is not None:
        wanted = np.array(expected["normal"], float)
        wanted /= np.linalg.norm(wanted)
        alike = sign * float(n @ wanted)
        if expected.get("normal_sign_free"):
            alike = abs(alike)
        assert alike == pytest.approx(1, abs=max(1e-6, tolerance)) or case["id"] in OTHER_NORMAL


def any_shape(record):
    match record["type"]:
        case "circle":
            return cm.Circle(record["radius"])
        case "polygon":
            return cm.Polygon(record["vertices"])
        case "capsule2d":
            return cm.Polygon([record["a"], record["b"]], record["radius"])
        case "triangle":
            return cm.Mesh(record["vertices"], [(0, 1, 2)])
    return shape(record)


def any_pose(record):
    if "angle" in record:
        half = record["angle"] / 2
        return cm.Pose((*record["pos"], 0.0), (0, 0, np.sin(half), np.cos(half)))
    return cm.Pose(record["pos"], record["quat"])


def of_the_api():
    """Cases that test_case does not cover: shapes of the plane, triangles, and times of impact."""
    cases, done = json.loads(CASES.read_text())["cases"] if CASES.exists() else [], {c["id"] for c in supported()}
    return [c for c in cases if c["id"] not in done and any_shape(c["shapeA"]) and any_shape(c["shapeB"])]


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("case", of_the_api(), ids=lambda c: str(c["id"]))
def test_case_of_the_api(case, swap):
    sides = ("B", "A") if swap else ("A", "B")
    shapes, poses = [any_shape(case[f"shape{s}"]) for s in sides], [any_pose(case[f"pose{s}"]) for s in sides]
    expected, tolerance = case["expected"], case["tolerance"] or 1e-9
    if "toi" in expected:
        velocity = [np.pad(case["motion"][s]["velocity"], (0, 3))[:3] for s in sides]
        motions = [cm.Motion(pose, v) for pose, v in zip(poses, velocity, strict=True)]
        i = cm.time_of_impact(shapes[0], motions[0], shapes[1], motions[1], horizon=20.0)
        if expected["toi"] is None:
            assert i.status == "clear"
        else:
            assert i.status == "hit"
            assert i.lower <= expected["toi"] + tolerance and expected["toi"] - tolerance <= i.upper
            assert i.upper - i.lower <= 1e-4
        return
    c = cm.contact(shapes[0], poses[0], shapes[1], poses[1])
    if expected.get("collide"):
        assert c.signed_distance <= 0.0
    if expected.get("touching"):
        assert abs(c.signed_distance) <= tolerance
        point = c.point_b if swap else c.point_a
        assert point[:2] == pytest.approx((expected["pA_x"], expected["pA_y"]), abs=tolerance)
    if "depth" in expected:
        assert -c.signed_distance == pytest.approx(expected["depth"], abs=tolerance)
        assert (-c.normal if swap else c.normal)[:2] == pytest.approx(expected["normal"], abs=tolerance)


def test_what_is_left_has_no_shape():
    """The remaining cases have planes without a solid side."""
    done = {c["id"] for c in (*supported(), *of_the_api())}
    left = [c for c in json.loads(CASES.read_text())["cases"] if c["id"] not in done]
    assert all({c["shapeA"]["type"], c["shapeB"]["type"]} & {"plane"} for c in left)
    assert (len(done), len(left)) == (219, 32)
