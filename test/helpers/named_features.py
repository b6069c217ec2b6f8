"""Published features of contacts: whether they contain a point, and whether `contact_features` names them too."""

from __future__ import annotations

import numpy as np

import collision_monitor as cm
from collision_monitor import Pose
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.point_triangle import closest_point_on_triangle


def random_pose(rng, reach):
    q = rng.normal(size=4)
    return Pose(rng.uniform(-reach, reach, 3), q / np.linalg.norm(q))


def off_feature(shape, x, kind, index):
    """Distance (m) of a point from the feature of a shape with this type and index of Contact.msg."""
    if isinstance(shape, cm.Cylinder | cm.Cone):
        above = index == 0 and isinstance(shape, cm.Cylinder)
        away, end = np.hypot(x[0], x[1]), shape.length / 2 * (1 if above else -1)
        if kind == 1:
            return np.linalg.norm(x - [0, 0, shape.length / 2])
        beside = max(away - shape.radius, 0.0) if kind == 3 else away - shape.radius
        if kind in (2, 3):
            return np.hypot(x[2] - end, beside)
        if isinstance(shape, cm.Cylinder):
            return abs(away - shape.radius)
        slant = shape.radius * (shape.length / 2 - x[2]) - shape.length * away
        return abs(slant) / np.hypot(shape.radius, shape.length)
    if isinstance(shape, cm.Box):
        half, side = np.array(shape.size) / 2, lambda number, bit: 1 if number >> bit & 1 else -1
        if kind == 1:
            return np.linalg.norm(x - half * [side(index, c) for c in range(3)])
        if kind == 3:
            return abs(x[index // 2] - half[index // 2] * (-1 if index % 2 else 1))
        a = (index // 4 + np.array([1, 2])) % 3
        return np.linalg.norm(x[a] - half[a] * [side(index, 0), side(index, 1)])
    if isinstance(shape, cm.ConvexHull):
        hull = convex_hull(shape.points)
        names = (shape.points == hull.vertices[:, None]).all(axis=-1).argmax(axis=1)
        found = []
        for face in hull.faces:
            for part in {1: [[k] for k in face], 2: [face[[0, 1]], face[[1, 2]], face[[2, 0]]], 3: [face]}[kind]:
                if names[part].min() == index:
                    found.append(hull.vertices[np.resize(part, 3)])
        return closest_point_on_triangle(x, *np.moveaxis(np.array(found), 1, 0))[1].min()
    face, c = (index, 0) if kind == 3 else divmod(index, 3)
    corners = np.roll(shape.vertices[shape.faces[face]], -c, axis=0)[:kind]
    return closest_point_on_triangle(x, *corners[np.minimum(range(3), kind - 1)][:, None])[1][0]


def agrees(shape, kind, index, expected):
    """Whether a published feature is that of `contact_features`."""
    if kind != expected.type:
        return False
    if kind == 4:
        return True
    if isinstance(shape, cm.Mesh) and kind < 3:
        at = shape.vertices[np.roll(shape.faces[index // 3], -(index % 3))[:kind]]
        return {*map(tuple, at)} == {*map(tuple, shape.vertices[list(expected.vertices)])}
    if isinstance(shape, cm.ConvexHull):
        return min(expected.vertices) == index
    if kind == 2:
        return not isinstance(shape, cm.Cylinder) or expected.vertices[0] == index
    return expected.face == index if kind == 3 else expected.vertices[0] == index
