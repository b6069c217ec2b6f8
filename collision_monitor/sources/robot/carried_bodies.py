"""Bodies that links of a robot carry: the links' own shapes and attached objects, as arrays for one step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.shapes.pose import Pose, multiply, rotation_matrix
from collision_monitor.shapes.registry import Shape
from collision_monitor.sources.ground.scene_states import empty_states

Floats = NDArray[np.float64]


@dataclass(eq=False)
class Body:
    """An object that moves with a link. offset: its pose in the frame of the link.

    touch: links whose contact with an attached object is expected.
    """

    object_id: int
    name: str
    link: str
    shapes: tuple[tuple[Shape, Pose], ...]
    offset: Pose = field(default_factory=Pose)
    touch: frozenset[str] = frozenset()


class CarriedBodies:
    """Bodies (N) as arrays: rows (N,) of their links, offsets (N, 3) and quaternions (N, 4) in the links' frames."""

    def __init__(self, bodies: Sequence[Body], links: Sequence[str]) -> None:
        self.ids = [body.object_id for body in bodies]
        self.rows = np.array([links.index(body.link) for body in bodies], np.intp)
        self._positions = np.array([body.offset.position for body in bodies]).reshape(-1, 3)
        self._quaternions = np.array([body.offset.quaternion for body in bodies]).reshape(-1, 4)
        self._at_links = not self._positions.any() and not self._quaternions[:, :3].any()

    def states(self, poses: Floats, twists: Floats) -> Any:
        """Return states (N,) of the bodies from poses (L, 7) and twists (L, 6) of all links."""
        states = empty_states(self.ids)
        at, moves = poses[self.rows], twists[self.rows]
        states["position"], states["quaternion"] = at[:, :3], at[:, 3:]
        states["linear"], states["angular"] = moves[:, :3], moves[:, 3:]
        if self._at_links:
            return states
        arms = (rotation_matrix(at[:, 3:]) @ self._positions[:, :, None])[:, :, 0]
        states["position"] += arms
        states["quaternion"] = multiply(at[:, 3:], self._quaternions)
        states["linear"] += np.cross(moves[:, 3:], arms)
        return states
