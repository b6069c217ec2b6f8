"""Figure of collisions from above: tracks around each, and footprints at the begin of the contact."""

from __future__ import annotations

from math import isnan
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.figure import Figure

from collision_monitor.report.facts import ReportFacts
from collision_monitor.report.footprint import footprint
from collision_monitor.report.object_tracks import ObjectTrack
from collision_monitor.report.rendering import INK, PALETTE, Size
from collision_monitor.session.history.history import CollisionEvent, Floats, History
from collision_monitor.settings.names import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes

EVENTS: Final = 6
"""Largest number of collisions that are drawn."""
AROUND: Final = 2.0
"""Time before and after a collision for which the tracks are drawn (s)."""
ZOOM: Final = 4.0
"""Largest ratio of half the width of a panel to the size of the larger body."""
POINTS: Final = 400
"""Largest number of points of a track."""


def chosen_events(facts: ReportFacts) -> list[CollisionEvent]:
    """Return the collisions to draw, in order of time.

    Collisions without a prediction have priority, those from the first step on come last, and deep ones come first.
    """
    worst = sorted(facts.collisions, key=lambda c: (isnan(c.warned), c.warned > 0.0, c.deepest, c.begin, c.pair))
    worst = worst[:EVENTS]
    return sorted(worst, key=lambda c: (c.begin, c.pair))


def from_above(history: History, facts: ReportFacts, size: Size) -> Figure | None:
    """Draw one panel for each chosen collision. Return None if there is none."""
    chosen = chosen_events(facts)
    if not chosen:
        return None
    columns = min(len(chosen), size.columns)
    rows = -(-len(chosen) // columns)
    side = min(size.width / columns, 3.9)
    figure = Figure(figsize=(size.width, (side + 0.75) * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, collision in zip(panels, chosen, strict=False):
        _panel(axes, history, facts, collision)
    for axes in panels[len(chosen) :]:
        axes.axis("off")
    return figure


def _panel(axes: Axes, history: History, facts: ReportFacts, collision: CollisionEvent) -> None:
    now = np.array([collision.begin])
    middle = _middle(history, facts, collision)
    tracks: list[Floats] = []
    bodies: list[Floats] = []
    for color, object_id in zip(PALETTE, collision.pair, strict=False):
        path, described = facts.tracks[object_id], history.objects.get(object_id)
        name = shortened(history.name_of(object_id), 22)
        axes.plot([], [], color=color, linewidth=4, alpha=0.6, label=name)
        if path is None:
            continue
        line = _line(path, collision.begin)[:, :2] - middle
        axes.plot(line[:, 0], line[:, 1], color=color, linewidth=1.2)
        tracks.append(line[np.isfinite(line[:, 0])])
        position, quaternion, _ = path.at(now)
        if described is None:
            axes.plot(*(position[0, :2] - middle), "o", color=color)
            continue
        for outline in footprint(described, position[0], quaternion[0]):
            axes.fill(*(outline - middle).T, facecolor=color, edgecolor=color, alpha=0.4, linewidth=1.2)
            if not described.static:
                bodies.append(outline - middle)
        if np.any(path.states["linear"]) and collision.begin - 0.5 * AROUND >= path.time[0]:
            earlier = path.at(now - 0.5 * AROUND)
            for outline in footprint(described, earlier[0][0], earlier[1][0]):
                axes.fill(*(outline - middle).T, facecolor="none", edgecolor=color, linestyle=":", linewidth=1)
    axes.plot(0.0, 0.0, "x", color=INK, markersize=6)
    _zoom(axes, tracks, bodies)
    x, y = np.round(middle, 2) + 0.0  # no -0.00
    axes.set_title(f"{collision.begin:.2f} s at ({x:.2f}, {y:.2f}) m")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(0.0, -0.12), borderaxespad=0.0, handlelength=0.8)
    axes.tick_params(labelsize=8)


def _middle(history: History, facts: ReportFacts, collision: CollisionEvent) -> Floats:
    """Return the point of contact (2,), or the position of the first known object if the point is unknown."""
    rows = history.contacts[history.contact_step == collision.step]
    rows = rows[(rows["id_a"] == collision.pair[0]) & (rows["id_b"] == collision.pair[1])]
    points = rows["point_a"][np.isfinite(rows["point_a"]).all(axis=1)]
    if not len(points):
        paths = [path for path in map(facts.tracks.__getitem__, collision.pair) if path is not None]
        points = np.array([path.at(np.array([collision.begin]))[0][0] for path in paths] or [np.zeros(3)])
    return np.asarray(points[0, :2], np.float64)


def _line(path: ObjectTrack, begin: float) -> Floats:
    """Return the positions (n, 3) around a time, with NaN before each jump."""
    near = np.flatnonzero(np.abs(path.time - begin) <= AROUND)
    near = near[:: max(-(-len(near) // POINTS), 1)]
    jumps = np.flatnonzero(path.jump[near])
    return np.insert(path.states["position"][near], jumps, np.nan, axis=0)


def _zoom(axes: Axes, tracks: list[Floats], bodies: list[Floats]) -> None:
    """Limit the panel to a square around the contact that shows the tracks, but keeps the bodies visible (ZOOM)."""
    far = max((float(np.abs(each).max()) for each in (*tracks, *bodies) if len(each)), default=0.0)
    largest = max((float(np.ptp(each, axis=0).max()) for each in bodies), default=far)
    half = 1.1 * min(far, ZOOM * largest) or 1.0
    axes.set_xlim(-half, half)
    axes.set_ylim(-half, half)
    axes.set_aspect("equal")
    axes.locator_params(nbins=5)
