"""Collisions from above: the tracks around each, and the footprints where the contact began."""

from __future__ import annotations

from math import isnan
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.figure import Figure

from collision_monitor.report.facts import Facts
from collision_monitor.report.footprint import FAR, footprint
from collision_monitor.report.picture import INK, PALETTE, Size
from collision_monitor.report.tracks import Track
from collision_monitor.session.history import Collision, Floats, History

if TYPE_CHECKING:
    from matplotlib.axes import Axes

EVENTS: Final = 6
"""Collisions that are drawn."""
AROUND: Final = 2.0
"""s of the tracks that are drawn before and after a collision."""
POINTS: Final = 400
"""Of a track, at most."""


def chosen_events(facts: Facts) -> list[Collision]:
    """The collisions that are drawn: not predicted ones first, those there from the start last; in order of time."""
    worst = sorted(facts.collisions, key=lambda c: (isnan(c.warned), c.warned > 0.0, c.deepest, c.begin, c.pair))
    worst = worst[:EVENTS]
    return sorted(worst, key=lambda c: (c.begin, c.pair))


def from_above(history: History, facts: Facts, size: Size) -> Figure | None:
    """One panel for each chosen collision; None where there is none."""
    chosen = chosen_events(facts)
    if not chosen:
        return None
    columns = min(len(chosen), size.columns)
    rows = -(-len(chosen) // columns)
    side = min(size.width / columns, 3.9)
    figure = Figure(figsize=(size.width, (side + 0.45) * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, collision in zip(panels, chosen, strict=False):
        _panel(axes, history, facts, collision)
    for axes in panels[len(chosen) :]:
        axes.axis("off")
    return figure


def _panel(axes: Axes, history: History, facts: Facts, collision: Collision) -> None:
    extents: list[Floats] = []
    now = np.array([collision.begin])
    for color, object_id in zip(PALETTE, collision.pair, strict=False):
        path, described = facts.tracks[object_id], history.objects.get(object_id)
        name = history.name_of(object_id)
        axes.plot([], [], color=color, linewidth=4, alpha=0.6, label=name if len(name) <= 20 else f"{name[:19]}…")
        if path is None:
            continue
        line = _line(path, collision.begin)
        axes.plot(line[:, 0], line[:, 1], color=color, linewidth=1.2)
        extents.append(line[np.isfinite(line[:, 0])])
        position, quaternion, _ = path.at(now)
        if described is None:
            axes.plot(position[:, 0], position[:, 1], "o", color=color)
            continue
        outlines = footprint(described, position[0], quaternion[0])
        for outline in outlines:
            axes.fill(*outline.T, facecolor=color, edgecolor=color, alpha=0.4, linewidth=1.2)
        extents += [outline for outline in outlines if np.ptp(outline, axis=0).max() < FAR]
        if np.any(path.linear) and collision.begin - 0.5 * AROUND >= path.time[0]:
            earlier = path.at(now - 0.5 * AROUND)
            for outline in footprint(described, earlier[0][0], earlier[1][0]):
                axes.fill(*outline.T, facecolor="none", edgecolor=color, linestyle=":", linewidth=1)
    rows = history.contacts[(history.contact_step == collision.step) & _of_pair(history, collision)]
    point = rows["point_a"][np.isfinite(rows["point_a"]).all(axis=1)]
    axes.plot(point[:, 0], point[:, 1], "x", color=INK, markersize=6)
    _look_at(axes, point[:, :2], extents)
    axes.set_title(f"{collision.begin:.2f} s")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(0.0, -0.12), borderaxespad=0.0, handlelength=0.8)
    axes.tick_params(labelsize=8)


def _of_pair(history: History, collision: Collision) -> Floats:
    rows = history.contacts
    return np.asarray((rows["id_a"] == collision.pair[0]) & (rows["id_b"] == collision.pair[1]))


def _line(path: Track, begin: float) -> Floats:
    """Positions (n, 3) around a time, with NaN before a jump."""
    near = np.flatnonzero(np.abs(path.time - begin) <= AROUND)
    near = near[:: max(-(-len(near) // POINTS), 1)]
    jumps = np.flatnonzero(path.jump[near])
    return np.insert(path.position[near], jumps, np.nan, axis=0)


def _look_at(axes: Axes, point: Floats, extents: list[Floats]) -> None:
    """A square about the contact that holds the smaller of the two and where they came from, not all of a long wall."""
    seen = [each for each in extents if len(each)]
    if not seen:
        return
    middle = point[0] if len(point) else np.mean([each[:, :2].mean(axis=0) for each in seen], axis=0)
    reaches = sorted(float(np.abs(each[:, :2] - middle).max()) for each in seen)
    half = 1.1 * max(reaches[: max(len(reaches) - 1, 1)])
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
