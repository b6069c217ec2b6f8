"""Draw the pictures of docs/geometry.md and docs/narrow_phase.md with the package's own functions.

    python docs/draw_geometry.py
"""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray
from scipy.spatial import ConvexHull as Qhull
from scipy.spatial import HalfspaceIntersection

from collision_monitor import Box, Mesh, Pose, contact
from collision_monitor.geometry.bounding_spheres import (
    minimal_sphere,
    sphere_from_centroid,
    sphere_from_widest_pair,
)
from collision_monitor.geometry.bounding_volumes import aabb, convex_hull, kdop_of_points
from collision_monitor.geometry.lecture.polygon_overlap import project, sat_2d
from collision_monitor.geometry.lecture.sphere_tree import distance_intervals, sphere_tree
from collision_monitor.geometry.oriented_boxes import obb_minimum_volume, obb_pca
from collision_monitor.geometry.triangulation import triangulate

Array = NDArray[np.float64]
IMAGES = Path(__file__).parent / "images"
POINTS, FILL, A, B, GAP = "#333333", "#0072b2", "#0072b2", "#d55e00", "#009e73"

mpl.rcParams.update({"svg.hashsalt": "collision_monitor", "font.size": 9, "axes.titlesize": 10})


def around(points: Array) -> Array:
    """Return the points (n, 2) in order around their mean."""
    offset = points - points.mean(axis=0)
    return points[np.argsort(np.arctan2(offset[:, 1], offset[:, 0]))]


def area(polygon: Array) -> float:
    """Area of a convex polygon with ordered corners (m²)."""
    following = np.roll(polygon, -1, axis=0)
    return 0.5 * abs(float((polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0]).sum()))


def bounding_volumes() -> None:
    """Draw each bounding volume of one set of points in the plane, with its area relative to the hull's."""
    rng = np.random.default_rng(4)
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    points = np.vstack([rng.uniform([0, 0], [4, 0.9], (40, 2)), rng.uniform([3.1, 0], [4, 2.2], (25, 2))]) @ turn.T
    # the spatial volumes contain the same points on two floors, seen from above
    floors = np.vstack([np.column_stack([points, np.full(len(points), z)]) for z in (0.0, 1.0)])
    hull = around(np.unique(convex_hull(floors).vertices[:, :2], axis=0))
    box = aabb(points)
    slabs = kdop_of_points(floors, [[1, 0, 0], [0, 1, 0], [1, 1, 0], [1, -1, 0]])
    flat = slabs.directions[:, :2]
    planes = np.vstack([np.column_stack([flat, -slabs.upper]), np.column_stack([-flat, slabs.lower])])
    corners = HalfspaceIntersection(planes, points.mean(axis=0)).intersections
    polygons = {
        "AABB": around(np.array([box.lower, [box.upper[0], box.lower[1]], box.upper, [box.lower[0], box.upper[1]]])),
        "OBB, PCA": around(np.unique(obb_pca(floors).corners[:, :2].round(9), axis=0)),
        "OBB, minimum volume": around(np.unique(obb_minimum_volume(floors).corners[:, :2].round(9), axis=0)),
        "8-DOP in the plane": around(np.unique(corners.round(9), axis=0)),
        "convex hull": hull,
    }
    circles = {
        "sphere from the centroid": sphere_from_centroid(points),
        "sphere from the widest pair": sphere_from_widest_pair(points),
        "minimal sphere (Welzl)": minimal_sphere(points),
    }
    figure, axes = plt.subplots(2, 4, figsize=(10, 5.4), constrained_layout=True, sharex=True, sharey=True)
    for axis, (name, circle) in zip(axes.flat, circles.items(), strict=False):
        axis.add_patch(Circle(tuple(circle.center), float(circle.radius), fc=FILL, alpha=0.18))
        axis.add_patch(Circle(tuple(circle.center), float(circle.radius), fill=False, ec=FILL))
        axis.plot(*circle.center, "+", color=FILL, ms=9)
        axis.set_title(f"{name}: {float(circle.volume) / area(hull):.2f}")
    for axis, (name, polygon) in zip(axes.flat[3:], polygons.items(), strict=True):
        axis.add_patch(Polygon(polygon, fc=FILL, alpha=0.18))
        axis.add_patch(Polygon(polygon, fill=False, ec=FILL))
        axis.set_title(f"{name}: {area(polygon) / area(hull):.2f}")
    for axis in axes.flat:
        axis.plot(*points.T, ".", color=POINTS, ms=3)
        axis.set_aspect("equal")
        axis.set_axis_off()
    save(figure, "bounding_volumes")


def draw_axis(plot: Any, normal: Array, at: float, a: Array, b: Array, found: bool) -> None:
    """Draw one axis of SAT with both projections on it, `at` metres across it from the origin."""
    along, across = normal, np.array([-normal[1], normal[0]])
    (low_a, high_a), (low_b, high_b) = project(a, normal), project(b, normal)
    ends = np.array([min(low_a, low_b) - 0.25, max(high_a, high_b) + 0.25])
    line = ends[:, None] * along + at * across
    plot.plot(*line.T, color="#888888", lw=0.8)
    plot.annotate("", line[1], line[0], arrowprops={"arrowstyle": "->", "color": "#888888", "lw": 0.8})
    for (low, high), color, shift in (((low_a, high_a), A, 0.06), ((low_b, high_b), B, -0.06)):
        bar = np.array([low, high])[:, None] * along + (at + shift) * across
        plot.plot(*bar.T, color=color, lw=3, solid_capstyle="butt")
    if found:
        gap = np.array([high_a, low_b])[:, None] * along + at * across
        plot.plot(*gap.T, color=GAP, lw=4, solid_capstyle="butt", zorder=5)
        for end in (high_a, low_b):  # the two lines that bound the empty strip
            strip = np.array([at, at + 4.2 * np.sign(-at)])[:, None] * across + end * along
            plot.plot(*strip.T, color=GAP, lw=0.8, ls="--")


def separating_axes() -> None:
    """Draw SAT for polygons apart, which ends at the first separating axis, and overlapping, with the translation."""
    a = np.array([[0.0, 0], [2.2, 0.2], [2.5, 1.4], [1.1, 2.3], [0, 1.5]])
    triangle = np.array([[0.0, 0.3], [1.7, -0.5], [1.4, 1.5]])
    figure, plots = plt.subplots(1, 2, figsize=(10, 4.9), constrained_layout=True)
    for plot, shift, title in (
        (plots[0], np.array([2.45, 1.55]), "apart"),
        (plots[1], np.array([1.7, 0.7]), "overlapping"),
    ):
        b = triangle + shift
        answer = sat_2d(a, b)
        edges = np.vstack([np.roll(a, -1, axis=0) - a, np.roll(b, -1, axis=0) - b])
        normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1, keepdims=True)
        shown = [0, answer.edge]
        for edge in shown:
            normal = answer.axis if edge == answer.edge else normals[edge]
            across = np.array([-normal[1], normal[0]])
            beside = (np.vstack([a, b]) @ across).min() - 0.45
            draw_axis(plot, normal, beside, a, b, found=edge == answer.edge and not answer.overlaps)
        for polygon, color, name in ((a, A, "A"), (b, B, "B")):
            plot.add_patch(Polygon(polygon, fc=color, alpha=0.25))
            plot.add_patch(Polygon(polygon, fill=False, ec=color, lw=1.4))
            plot.text(*polygon.mean(axis=0), name, color=color, ha="center", va="center", fontsize=13)
        if answer.overlaps:
            moved = b - answer.distance * answer.axis
            plot.add_patch(Polygon(moved, fill=False, ec=B, ls=":", lw=1.2))
            plot.annotate("", moved[1], b[1], arrowprops={"arrowstyle": "->", "color": GAP, "lw": 2})
            note = f"depth {-answer.distance:.2f} m; all {answer.tested} axes overlap;\narrow: minimum translation"
        else:
            note = f"gap {answer.distance:.2f} m on axis {answer.tested} of 8, where the test ends"
        plot.set_title(f"{title}: {note}")
        plot.set_aspect("equal")
        plot.set_axis_off()
    save(figure, "sat_2d")


def save(figure: Any, name: str) -> None:
    """Save as SVG without a date, so that the same picture gives the same file."""
    IMAGES.mkdir(exist_ok=True)
    figure.savefig(IMAGES / f"{name}.svg", metadata={"Date": None})
    plt.close(figure)


def prism(polygon: Array, height: float) -> tuple[Array, NDArray[np.int64]]:
    """Closed mesh between a counter-clockwise polygon (n, 2) and its copy `height` metres above."""
    n = len(polygon)
    vertices = np.vstack([np.column_stack([polygon, np.full(n, z)]) for z in (0.0, height)])
    k, after = np.arange(n), (np.arange(n) + 1) % n
    sides = np.concatenate([np.stack([k, after, after + n], 1), np.stack([k, after + n, k + n], 1)])
    floor = triangulate(polygon)
    return vertices, np.concatenate([sides, floor[:, ::-1], floor + n]).astype(np.int64)


U_PROFILE = np.array([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], float)


def sphere_trees() -> None:
    """Draw the levels of a sphere tree from above, and the interval of a distance after each level."""
    vertices, faces = prism(U_PROFILE, 0.75)
    tree = sphere_tree(vertices, faces, depth=6)
    figure, axes = plt.subplots(1, 5, figsize=(12, 2.9), constrained_layout=True, width_ratios=[1, 1, 1, 1, 1.3])
    for axis, k in zip(axes, (0, 2, 3, 4), strict=False):
        level = tree[k]
        for x, y, radius in np.unique(np.column_stack([level.center[:, :2], level.radius]).round(9), axis=0):
            axis.add_patch(Circle((x, y), radius, fill=False, ec=A, lw=0.6))
        balls = np.column_stack([level.inner_center[:, :2], level.inner_radius])[level.inner_radius > 0.0]
        for x, y, radius in np.unique(balls.round(9), axis=0):
            axis.add_patch(Circle((x, y), radius, fc=GAP, alpha=0.25, lw=0))
        axis.add_patch(Polygon(U_PROFILE, fill=False, ec=POINTS, lw=1.4))
        axis.set_title(f"level {k}: {len(level.radius):,} " + ("sphere" if k == 0 else "spheres"))
        axis.set_xlim(-0.9, 3.9)
        axis.set_ylim(-0.9, 3.9)
        axis.set_aspect("equal")
        axis.set_axis_off()
    pose = Pose((4.5, 1.0, 0.2), (0.0, 0.0, np.sin(0.3), np.cos(0.3)))
    intervals = np.array(list(distance_intervals(tree, Pose(), tree, pose)))
    true = contact(Mesh(vertices, faces), Pose(), Mesh(vertices, faces), pose).signed_distance
    levels = np.arange(len(intervals))
    axes[4].fill_between(levels, *intervals.T, color=A, alpha=0.18)
    axes[4].plot(levels, intervals, "o-", color=A, ms=3, lw=1)
    axes[4].axhline(true, color=B, lw=1, ls="--")
    axes[4].set(xlabel="level", title=f"distance of two of them: {true:.3f} m")
    axes[4].spines[["top", "right"]].set_visible(False)
    save(figure, "sphere_tree")


def contact_patches() -> None:
    """Draw the contact points of two boxes from above: face on face, also turned, and an edge on a face."""
    figure, plots = plt.subplots(1, 3, figsize=(10, 3.4), constrained_layout=True)
    low, high = Box((2.4, 1.6, 1.0)), Box((1.8, 1.2, 1.0))
    for plot, turn, tilt, title in (
        (plots[0], 0.0, 0.0, "face on face"),
        (plots[1], 0.6, 0.0, "face on face, turned"),
        (plots[2], 0.6, np.pi / 4, "edge on face"),
    ):
        stand = 0.5 + (0.5 if tilt == 0.0 else 0.5 * (np.cos(tilt) + 1.2 * np.sin(tilt)))
        tilted = Pose((0.0, 0.0, 0.0), (np.sin(tilt / 2), 0.0, 0.0, np.cos(tilt / 2)))
        pose = Pose((0.5, 0.4, stand - 0.01), (0.0, 0.0, np.sin(turn / 2), np.cos(turn / 2))) @ tilted
        found = contact(low, Pose(), high, pose)
        corners = np.array(list(product((-0.5, 0.5), repeat=3)))
        for box, where, color in ((low, Pose(), A), (high, pose, B)):
            seen = (corners * box.size) @ where.rotation.T + where.position
            outline = around(convex_hull(seen).vertices[:, :2])
            outline = outline[Qhull(outline).vertices]
            plot.add_patch(Polygon(outline, fc=color, alpha=0.15))
            plot.add_patch(Polygon(outline, fill=False, ec=color, lw=1.2))
        patch = around(found.points_a[:, :2])
        plot.add_patch(Polygon(patch, closed=True, fc=GAP, alpha=0.35, ec=GAP, lw=1.5))
        plot.plot(*found.points_a[:, :2].T, "o", color=GAP, ms=6)
        plot.plot(*found.point_a[:2], "+", color=POINTS, ms=9)
        plot.set_title(f"{title}: {len(found.points_a)} points")
        plot.autoscale_view()
        plot.set_aspect("equal")
        plot.set_axis_off()
    save(figure, "contact_patches")


if __name__ == "__main__":
    bounding_volumes()
    separating_axes()
    sphere_trees()
    contact_patches()
