"""The tree of frames from a bag's tf2 messages: the pose of one frame in another, as far as it is known.

A moving link has its last transform, without interpolation, as in a node that does not wait.
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
    """The pose of a frame in another: position (3,) in m, quaternion (4,), not checked to be of unit length."""

    position: Floats
    quaternion: Floats

    def __matmul__(self, other: Placement) -> Placement:
        """Return X_AB @ X_BC = X_AC."""
        position = self.position + rotation_matrix(self.quaternion) @ other.position
        return Placement(position, multiply(self.quaternion, other.quaternion))

    def inverse(self) -> Placement:
        """Return X_BA of X_AB."""
        back = self.quaternion * (-1.0, -1.0, -1.0, 1.0)
        return Placement(-rotation_matrix(back) @ self.position, back)


IDENTITY: Final = Placement(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))


def placement(message: Any) -> Placement:
    """Return the placement of a geometry_msgs Pose or Transform."""
    p = message.translation if hasattr(message, "translation") else message.position
    q = message.rotation if hasattr(message, "rotation") else message.orientation
    return Placement(np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w]))


def frame_name(name: str) -> str:
    """Return the tf2 name of a frame. tf's names may begin with a slash."""
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
        """Set the pose of a frame in its parent from now on."""
        self._links[child] = _Link(parent, where, static)

    @property
    def frames(self) -> list[str]:
        """Names of all frames that were mentioned."""
        return sorted({*self._links, *(link.parent for link in self._links.values())})

    def find(self, target: str, source: str) -> Placement | None:
        """Return X_target_source; None if no links connect them."""
        if target == source:
            return IDENTITY
        to_target = dict(self._upward(target))
        for frame, to_source in self._upward(source):
            if frame in to_target:
                return to_target[frame].inverse() @ to_source
        return None

    def nearest_moving(self, frame: str) -> str | None:
        """Return the frame itself, or the first above it, whose link to its parent is not static."""
        seen: set[str] = set()
        while frame in self._links and frame not in seen:
            seen.add(frame)
            link = self._links[frame]
            if not link.static:
                return frame
            frame = link.parent
        return None

    def _upward(self, frame: str) -> Iterator[tuple[str, Placement]]:
        """Yield the frame and all above it, each with the pose of the first one in it. A loop is walked once."""
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
