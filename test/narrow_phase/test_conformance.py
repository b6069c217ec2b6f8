"""Cases from the test suites of FCL, libccd and parry, where the folder with them stands beside the repository."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from minkowski import rotation
from pairs import contact, size

from collision_monitor.geometry.pose import rotation_matrix
from collision_monitor.geometry.shapes import Box, Capsule, Cone, Cylinder, HalfSpace, Sphere

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
        c
        for c in cases
        if c["dim"] == 3 and shape(c["shapeA"]) and shape(c["shapeB"]) and "toi" not in c["expected"]
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
