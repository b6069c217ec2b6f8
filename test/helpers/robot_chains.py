"""Random robots, and where their links are at constant joint rates, by SciPy's rotations alone."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
RADIUS = 0.2
KINDS = ("revolute", "continuous", "prismatic", "fixed")


@dataclass
class ChainJoint:
    """Joint k, which carries link k + 1. follows: index of its leader, with multiplier and offset; None: free."""

    kind: str
    parent: int
    xyz: Array
    rpy: Array
    axis: Array
    limits: tuple[float, float] = (-inf, inf)
    follows: tuple[int, float, float] | None = None

    def text(self, k: int) -> str:
        lower, upper = self.limits
        limit = f'<limit lower="{lower!r}" upper="{upper!r}" effort="1" velocity="1"/>' if upper < inf else ""
        mimic = ""
        if self.follows is not None:
            leader, multiplier, offset = self.follows
            mimic = f'<mimic joint="joint_{leader}" multiplier="{multiplier!r}" offset="{offset!r}"/>'
        xyz, rpy, axis = (" ".join(map(repr, each.tolist())) for each in (self.xyz, self.rpy, self.axis))
        return f"""<joint name="joint_{k}" type="{self.kind}"><parent link="link_{self.parent}"/>
            <child link="link_{k + 1}"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}{mimic}</joint>"""


def urdf_of(joints: list[ChainJoint], radius: float = RADIUS) -> str:
    """A robot whose links are balls about their origins."""
    ball = f'<collision><geometry><sphere radius="{radius}"/></geometry></collision>'
    links = "".join(f'<link name="link_{k}">{ball}</link>' for k in range(len(joints) + 1))
    return f'<robot name="r">{links}{"".join(each.text(k) for k, each in enumerate(joints))}</robot>'


def random_chain(rng: np.random.Generator, count: int) -> list[ChainJoint]:
    """Joints of all kinds, some with limits, some that follow others; mostly one after the other."""
    made: list[ChainJoint] = []
    for k in range(count):
        kind = str(rng.choice(KINDS, p=[0.5, 0.1, 0.25, 0.15]))
        leaders = [i for i, each in enumerate(made) if each.follows is None and each.kind != "fixed"]
        follows = None
        if kind != "fixed" and leaders and rng.random() < 0.2:
            follows = int(rng.choice(leaders)), float(rng.normal()), float(rng.normal())
        limits = (-inf, inf)
        if kind in ("revolute", "prismatic") and follows is None and rng.random() < 0.5:
            limits = -float(rng.uniform(0.1, 2.0)), float(rng.uniform(0.1, 2.0))
        axis = rng.normal(size=3)
        made.append(
            ChainJoint(
                kind,
                k if rng.random() < 0.8 else int(rng.integers(0, k + 1)),
                rng.normal(0.0, 0.3, 3),
                rng.uniform(-2.0, 2.0, 3),
                axis / np.linalg.norm(axis),
                limits,
                follows,
            )
        )
    return made


def moved(q: float, rate: float, limits: tuple[float, float], t: Array) -> Array:
    """Position of a joint at times: it stops at a limit that it comes to from within."""
    lower, upper = limits
    at = q + rate * t
    if rate > 0.0 and q < upper:
        at = np.minimum(at, upper)
    if rate < 0.0 and q > lower:
        at = np.maximum(at, lower)
    return np.asarray(at)


def link_poses(
    joints: list[ChainJoint], q: dict[str, float], qd: dict[str, float], t: Array, base: tuple[Array, Rotation]
) -> list[tuple[Array, Rotation]]:
    """Positions (n, 3) and rotations of all links at times (n,), at constant rates. base: those of the base link."""
    limits = {f"joint_{k}": each.limits for k, each in enumerate(joints)}
    return link_poses_at(joints, {name: moved(q[name], qd[name], limits[name], t) for name in q}, base)


def link_poses_at(
    joints: list[ChainJoint], q: dict[str, Array], base: tuple[Array, Rotation]
) -> list[tuple[Array, Rotation]]:  # fmt: skip
    """Positions (n, 3) and rotations of all links where the joints are at positions (n,)."""
    poses: list[Any] = [base]
    for k, joint in enumerate(joints):
        position, rotation = poses[joint.parent]
        rotation_0 = rotation * Rotation.from_euler("xyz", joint.rpy)
        position = position + rotation.apply(joint.xyz)
        if joint.kind != "fixed":
            leader, multiplier, offset = joint.follows or (k, 1.0, 0.0)
            value = multiplier * q[f"joint_{leader}"] + offset
            if joint.kind == "prismatic":
                position = position + rotation_0.apply(value[:, None] * joint.axis)
            else:
                rotation_0 = rotation_0 * Rotation.from_rotvec(value[:, None] * joint.axis)
        poses.append((position, rotation_0))
    return poses


def stands(t: Array) -> tuple[Array, Rotation]:
    """A base at rest at the origin at times (n,)."""
    return np.zeros((len(t), 3)), Rotation.from_quat(np.tile([0.0, 0, 0, 1], (len(t), 1)))


def excess(plan: Any, poses: tuple[Array, Rotation], t: Array, points: Array) -> Array:
    """By how much (m) points of a link are farther off its plan at times than its tube says (n,)."""
    rows = plan.rows(t)
    position, rotation = poses
    off = np.zeros(len(t))
    planned = Rotation.from_quat(rows[:, 3:7])
    for point in points:
        there = position + rotation.apply(point) - rows[:, :3] - planned.apply(point)
        off = np.maximum(off, np.linalg.norm(there, axis=1))
    return np.asarray(off - plan.tubes[plan.piece(t)])


def sphere_points(rng: np.random.Generator, count: int = 8) -> Array:
    """Points (count, 3) on the balls of `urdf_of`."""
    points = rng.normal(size=(count, 3))
    return np.asarray(RADIUS * points / np.linalg.norm(points, axis=1, keepdims=True))
