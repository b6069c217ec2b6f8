"""Poses and twists of links against Pinocchio's, and against matrix exponentials for random trees of joints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from collision_monitor.robots.kinematic_tree import kinematic_tree
from collision_monitor.robots.link_motions import link_motions
from collision_monitor.robots.urdf import parse_urdf

ROOT = Path(__file__).parents[2]
MODELS = {path.stem: path for path in (ROOT / "examples/arm/arm.urdf", *(Path(__file__).parent / "models").glob("*"))}
REFERENCE = np.load(Path(__file__).parent / "pin_reference.npz")
"""Answers of Pinocchio 4.1 from benchmarks/links_against_pin.py, which compares 10,000 states and public robots."""


@pytest.mark.parametrize("name", sorted(MODELS))
def test_motions_are_those_of_pinocchio(name: str) -> None:
    tree = kinematic_tree(parse_urdf(MODELS[name].read_text(), name))
    reference = {key: REFERENCE[f"{name}.{key}"] for key in ("joints", "base", "position", "rotation", "twist")}
    poses, twists = link_motions(tree.table, reference["joints"], reference["base"])
    np.testing.assert_allclose(poses[..., :3], reference["position"], rtol=0, atol=1e-12)
    turned = Rotation.from_quat(poses[..., 3:].reshape(-1, 4)).as_matrix().reshape(reference["rotation"].shape)
    np.testing.assert_allclose(turned, reference["rotation"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(twists, reference["twist"], rtol=0, atol=1e-9)


JOINT_TYPES = ("fixed", "revolute", "continuous", "prismatic")
number = st.floats(-2.0, 2.0).map(lambda x: round(x, 3))
vectors = st.tuples(number, number, number)
axes = vectors.filter(lambda v: np.linalg.norm(v) > 0.1)
joint = st.tuples(st.sampled_from(JOINT_TYPES), vectors, vectors, axes, number, number, st.integers(0, 7))


def words(values: Any) -> str:
    return " ".join(map(str, values))


def random_urdf(joints: list[Any]) -> tuple[str, list[dict[str, Any]]]:
    """Return a URDF whose joint k carries link k + 1, and the same as a list of facts."""
    facts: list[dict[str, Any]] = []
    text = '<robot name="random"><link name="link_0"/>'
    for k, (kind, xyz, rpy, axis, _, _, choice) in enumerate(joints):
        moving = [i for i, other in enumerate(facts) if other["kind"] != "fixed"]
        leader = moving[choice % len(moving)] if kind != "fixed" and moving and choice % 3 == 0 else None
        facts.append(
            {"kind": kind, "xyz": xyz, "rpy": rpy, "axis": np.array(axis) / np.linalg.norm(axis), "leader": leader}
        )
        facts[-1]["parent"] = choice % (k + 1)
        mimic = "" if leader is None else f'<mimic joint="joint_{leader}" multiplier="-0.5" offset="0.25"/>'
        text += f"""<link name="link_{k + 1}"/><joint name="joint_{k}" type="{kind}">{mimic}
            <parent link="link_{choice % (k + 1)}"/><child link="link_{k + 1}"/>
            <origin xyz="{words(xyz)}" rpy="{words(rpy)}"/><axis xyz="{words(axis)}"/></joint>"""
    return text + "</robot>", facts


def generator(kind: str, axis: Any) -> Any:
    """Return the screw of a joint as a matrix (4, 4), whose exponential is the joint's motion."""
    S = np.zeros((4, 4))
    if kind == "prismatic":
        S[:3, 3] = axis
    elif kind != "fixed":
        x, y, z = axis
        S[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    return S


@settings(max_examples=40)
@given(st.lists(joint, min_size=1, max_size=8))
def test_motions_are_products_of_exponentials_and_their_derivatives(joints: list[Any]) -> None:
    text, facts = random_urdf(joints)
    states = [(position, speed) for *_, position, speed, _ in joints]
    for k, fact in enumerate(facts):
        if fact["leader"] is not None:
            position, speed = states[fact["leader"]]
            states[k] = (-0.5 * position + 0.25, -0.5 * speed)
    X, dX = [np.eye(4)], [np.zeros((4, 4))]  # X_W,link and its derivative by time
    for fact, (position, speed) in zip(facts, states, strict=True):
        origin = np.eye(4)
        origin[:3, :3] = Rotation.from_euler("xyz", fact["rpy"]).as_matrix()
        origin[:3, 3] = fact["xyz"]
        S = generator(fact["kind"], fact["axis"])
        move = expm(S * position)
        above, d_above = X[fact["parent"]], dX[fact["parent"]]
        X.append(above @ origin @ move)
        dX.append(d_above @ origin @ move + above @ origin @ move @ S * speed)

    tree = kinematic_tree(parse_urdf(text, "random"))
    values = np.array([states[int(name.removeprefix("joint_"))] for name in tree.joints]).reshape(1, -1, 2)
    poses, twists = link_motions(tree.table, values, np.eye(1, 13, 6))
    for row, name in enumerate(tree.links):
        k = int(name.removeprefix("link_"))
        R = X[k][:3, :3]
        spin = dX[k][:3, :3] @ R.T
        np.testing.assert_allclose(poses[0, row, :3], X[k][:3, 3], rtol=0, atol=1e-13)
        np.testing.assert_allclose(Rotation.from_quat(poses[0, row, 3:]).as_matrix(), R, rtol=0, atol=1e-13)
        np.testing.assert_allclose(twists[0, row, :3], dX[k][:3, 3], rtol=0, atol=1e-12)
        np.testing.assert_allclose(twists[0, row, 3:], (spin[2, 1], spin[0, 2], spin[1, 0]), rtol=0, atol=1e-12)
        needed = {name for name, needs in zip(tree.joints, tree.needs[row], strict=True) if needs}
        assert needed == leaders_of(k, facts)


def leaders_of(k: int, facts: list[dict[str, Any]]) -> set[str]:
    """Return the joints that the pose of link k depends on."""
    found = set()
    while k > 0:
        source = k - 1
        while facts[source]["leader"] is not None:
            source = facts[source]["leader"]
        if facts[source]["kind"] != "fixed":
            found.add(f"joint_{source}")
        k = facts[k - 1]["parent"]
    return found
