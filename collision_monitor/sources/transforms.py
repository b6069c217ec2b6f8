"""The tree of frames that a bag tells by tf2: where one frame stands in another, as far as that was said.

A moving link is taken at its last transform, not interpolated: as a node sees it that does not wait.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.pose import multiply, rotation_matrix

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Placement:
    """A frame in another: position (3,) in m, quaternion (4,), not checked to be of unit length."""

    position: Floats
    quaternion: Floats

    def __matmul__(self, other: Placement) -> Placement:
        """X_AB @ X_BC = X_AC."""
        position = self.position + rotation_matrix(self.quaternion) @ other.position
        return Placement(position, multiply(self.quaternion, other.quaternion))

    def inverse(self) -> Placement:
        """X_BA of X_AB."""
        back = self.quaternion * (-1.0, -1.0, -1.0, 1.0)
        return Placement(-rotation_matrix(back) @ self.position, back)


IDENTITY: Final = Placement(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))


def placement(message: Any) -> Placement:
    """Of a geometry_msgs Pose or Transform."""
    p = message.translation if hasattr(message, "translation") else message.position
    q = message.rotation if hasattr(message, "rotation") else message.orientation
    return Placement(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))


def frame_name(name: str) -> str:
    """tf's names, which may begin with a slash, as tf2's."""
    return name.removeprefix("/")


@dataclass(frozen=True)
class _Link:
    parent: str
    placement: Placement
    static: bool


class TransformTree:
    """Frames and the links between them."""

    def __init__(self) -> None:
        self._links: dict[str, _Link] = {}

    def put(self, parent: str, child: str, where: Placement, *, static: bool) -> None:
        """Where a frame stands in its parent from now on."""
        self._links[child] = _Link(parent, where, static)

    @property
    def frames(self) -> list[str]:
        """All that were mentioned."""
        return sorted({*self._links, *(link.parent for link in self._links.values())})

    def find(self, target: str, source: str) -> Placement | None:
        """X_target_source; None where no links join them."""
        if target == source:
            return IDENTITY
        to_target = dict(self._upward(target))
        for frame, to_source in self._upward(source):
            if frame in to_target:
                return to_target[frame].inverse() @ to_source
        return None

    def nearest_moving(self, frame: str) -> str | None:
        """The frame itself or the first above it whose link to its parent is no static one."""
        seen: set[str] = set()
        while frame in self._links and frame not in seen:
            seen.add(frame)
            link = self._links[frame]
            if not link.static:
                return frame
            frame = link.parent
        return None

    def _upward(self, frame: str) -> Iterator[tuple[str, Placement]]:
        """The frame and all above it, each with where the first one stands in it; a loop is walked once."""
        seen: set[str] = set()
        where = IDENTITY
        while frame not in seen:
            yield frame, where
            seen.add(frame)
            link = self._links.get(frame)
            if link is None:
                return
            where = link.placement @ where
            frame = link.parent
