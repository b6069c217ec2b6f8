"""`plot`: a picture of two shapes with their witness points."""

from __future__ import annotations

from typing import Any

import numpy as np

from collision_monitor.query.contact.contact import Contact
from collision_monitor.shapes.compound import shape_pairs
from collision_monitor.shapes.planar import is_planar
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Circle, HalfSpace, Shape, kind_of

COLOURS = "tab:blue", "tab:orange"


def plot(contact: Contact, axes: Any = None) -> Any:
    """Draw the two shapes of a contact, their witness points and the normal; return the matplotlib axes.

    axes: matplotlib axes to draw into, with projection="3d" for solids; a new figure without them. Shapes of the plane
    are drawn in 2-D. `cm.plot(c).figure.savefig("contact.png")` writes a file.

    >>> import matplotlib; matplotlib.use("agg")
    >>> import collision_monitor as cm
    >>> c = cm.contact(cm.Box((1, 1, 1)), cm.Pose(), cm.Capsule(0.2, 1), cm.Pose((1, 0, 0.5)))
    >>> cm.plot(c).get_title()
    'Contact(0.3 m ± ..., box face 0 – capsule surface)'
    """
    shape_a, pose_a, shape_b, pose_b = contact.arguments
    sides = [
        [(shape, pose @ local) for shape, local in shape_pairs(given, "shape")]
        for given, pose in ((shape_a, pose_a), (shape_b, pose_b))
    ]
    flat = is_planar(sides[0][0][0])
    if axes is None:
        from matplotlib import pyplot

        axes = pyplot.figure().add_subplot(projection=None if flat else "3d")
    extent = []
    for side, colour in zip(sides, COLOURS, strict=True):
        for shape, pose in side:
            extent.append((_draw_flat if flat else _draw_solid)(axes, shape, pose, colour))
    size = slice(0, 2 if flat else 3)
    ends = np.array([contact.point_a, contact.point_b])[:, size]
    axes.plot(*ends.T, "k-", linewidth=1.5)
    for point, colour, name in zip(ends, COLOURS, "AB", strict=True):
        axes.plot(*point[:, None], "o", color=colour, markeredgecolor="black", label=f"point {name}", zorder=9)
    bounded = [points for points in extent if len(points)]
    _set_limits(axes, np.concatenate([*bounded, ends]))
    axes.set(title=repr(contact), xlabel="x (m)", ylabel="y (m)", **({} if flat else {"zlabel": "z (m)"}))
    axes.legend()
    return axes


def _draw_flat(axes: Any, shape: Shape, pose: Pose, colour: str) -> Any:
    if isinstance(shape, Circle):
        angle = np.linspace(0.0, 2.0 * np.pi, 100)
        own = shape.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    else:
        own = np.asarray(shape.points)  # type: ignore[attr-defined]
    points = (own @ pose.rotation[:2, :2].T) + pose.position[:2]
    axes.fill(*points.T, color=colour, alpha=0.4)
    return points


def _draw_solid(axes: Any, shape: Shape, pose: Pose, colour: str) -> Any:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    triangles = kind_of(shape).triangles(shape) @ pose.rotation.T + pose.position
    faces = Poly3DCollection(triangles, facecolor=colour, edgecolor=colour, linewidth=0.2, alpha=0.25)
    axes.add_collection3d(faces)
    return np.zeros((0, 3)) if isinstance(shape, HalfSpace) else triangles.reshape(-1, 3)  # a half-space has no end


def _set_limits(axes: Any, points: Any) -> None:
    """One scale for all axes."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.55 * float((high - low).max())
    for name, middle in zip("xyz", (low + high) / 2, strict=False):
        getattr(axes, f"set_{name}lim")(middle - half, middle + half)
    if points.shape[1] == 2:
        axes.set_aspect("equal")
    else:
        axes.set_box_aspect((1, 1, 1))
