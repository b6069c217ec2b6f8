"""Picture of the conflicts of plans: the plans from above, and a time line."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure

from collision_monitor.motion.trajectory import Trajectory
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.query.conflicts.conflicts import Conflict
from collision_monitor.query.conflicts.planned_scene import PlannedScene
from collision_monitor.report.footprint import footprint
from collision_monitor.report.rendering import CONTACT, INK, PALETTE, POSSIBLE, WARNING, styled
from collision_monitor.settings.names import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROWS: Final = 40
"""Most objects on the time line: those with conflicts first."""

POINTS: Final = 300
"""Points of a plan that are drawn."""

OUTLINES: Final = 3000
"""Most static objects that are drawn."""

NUMBERS: Final = 60
"""Most conflicts whose numbers are written beside them."""


def draw_plans(scene: PlannedScene, plans: dict[str, Trajectory], found: list[Conflict], path: Path) -> None:
    """Draw plans with times from the begin on, and their conflicts, to a file. Raises OSError."""
    with styled():
        names = _rows(plans, found)
        figure = Figure(figsize=(9.0, 7.5 + 0.2 * len(names)), layout="constrained")
        above, line = figure.subplots(2, 1, height_ratios=[6.0, 1.0 + 0.2 * len(names)])
        _draw_above(above, scene, plans, found)
        _draw_times(line, names, plans, found)
        figure.savefig(path, dpi=130, facecolor="white")


def _rows(plans: dict[str, Trajectory], found: list[Conflict]) -> list[str]:
    named = dict.fromkeys(name for each in found for name in (each.a, each.b) if name in plans)
    return [*map(str, named), *(name for name in plans if name not in named)][:ROWS]


def _colors(plans: dict[str, Trajectory]) -> dict[str, str]:
    return {name: PALETTE[k % len(PALETTE)] for k, name in enumerate(plans)}


def _outlines(parts: Any, pose: Any) -> list[Any]:
    return footprint(ObjectDescription(0, list(parts)), pose.position, pose.quaternion)


def _draw_above(axes: Axes, scene: PlannedScene, plans: dict[str, Trajectory], found: list[Conflict]) -> None:
    seen = []
    for parts, pose in list(scene.static.values())[:OUTLINES]:
        for outline in _outlines(parts, pose):
            axes.fill(*outline.T, facecolor=POSSIBLE, alpha=0.35, linewidth=0.0)
    for name, color in _colors(plans).items():
        plan = plans[name]
        way = plan.rows(np.linspace(max(float(plan.times[0]), 0.0), float(plan.times[-1]), POINTS))[:, :2]
        seen.append(way)
        axes.plot(*way.T, color=color, linewidth=0.9, alpha=0.7)
        for outline in _outlines(scene.shapes[name], plan.at(max(float(plan.times[0]), 0.0))):
            axes.fill(*outline.T, facecolor=color, edgecolor=color, alpha=0.5, linewidth=0.8)
    for k, each in enumerate(found, 1):
        if (touch := each.contact) is None:
            continue
        color = CONTACT if each.status == "hit" else WARNING
        axes.plot(*touch.point_a[:2], "o", color=color, markersize=6, markerfacecolor="none")
        if k <= NUMBERS:
            x, y = touch.point_a[:2].tolist()
            axes.annotate(str(k), (x, y), (4, 4), textcoords="offset points", fontsize=7, color=color)
    points = np.concatenate(seen)
    middle, half = 0.5 * (points.min(0) + points.max(0)), 0.55 * np.ptp(points, axis=0).max() + 1.0
    axes.set_xlim(middle[0] - half * 1.3, middle[0] + half * 1.3)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    axes.set_title(f"{len(plans)} plans from above, at their begins (m); conflicts numbered by time")


def _draw_times(axes: Axes, names: list[str], plans: dict[str, Trajectory], found: list[Conflict]) -> None:
    row, colors = {name: k for k, name in enumerate(names)}, _colors(plans)
    end = max(float(plan.times[-1]) for plan in plans.values())
    end = max([end, *(t for each in found for t in (*each.entry, *each.exit) if t < inf)])
    for name, k in row.items():
        first, last = max(float(plans[name].times[0]), 0.0), float(plans[name].times[-1])
        axes.plot([first, last], [k, k], color=colors[name], linewidth=1.5, alpha=0.6)
    for number, each in enumerate(found, 1):
        color, until = (CONTACT if each.status == "hit" else WARNING), min(each.exit[1], end)
        ends = [row[str(name)] for name in (each.a, each.b) if str(name) in row]
        for k in ends:
            axes.plot([each.entry[0], until], [k, k], color=color, linewidth=5.0, solid_capstyle="butt")
        if len(ends) == 2:
            axes.plot([each.entry[0]] * 2, ends, color=color, linewidth=0.5, alpha=0.6)
        if ends and number <= NUMBERS:
            axes.annotate(str(number), (each.entry[0], ends[0]), (0, 3), textcoords="offset points", fontsize=6)
    axes.set_yticks(range(len(names)), [shortened(name, 20) for name in names], fontsize=7)
    axes.set_ylim(len(names) - 0.4, -0.8)
    axes.set_xlim(0.0, end)
    axes.set_xlabel("time from the first point of all plans (s)")
    axes.tick_params(colors=INK)
    more = f", {len(plans) - len(names)} more without conflicts are not shown" if len(plans) > len(names) else ""
    axes.set_title(f"conflicts: red certain, orange unresolved{more}")
