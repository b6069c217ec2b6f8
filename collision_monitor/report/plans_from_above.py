"""Plans of objects from above, beside the ways that they took, and a table of those that left theirs."""

from __future__ import annotations

from html import escape
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from collision_monitor.report.facts import ReportFacts
from collision_monitor.report.rendering import CONTACT, PALETTE, Size
from collision_monitor.session.history.history import History, PlanUse
from collision_monitor.settings.names import shortened

DRAWN: Final = len(PALETTE)
"""Objects whose plans are drawn, those that left theirs most often first."""

TRACK: Final = 2000
"""Points of a way."""

ROWS: Final = 100
"""Objects in the table."""

LISTED: Final = 10
"""Times of an object in the table."""


def plan_figure(history: History, facts: ReportFacts, size: Size) -> Figure | None:
    """Draw planned and driven ways; None without plans."""
    chosen = _worst(history)[:DRAWN]
    if not chosen:
        return None
    figure = Figure(figsize=(size.width, 0.75 * size.width), layout="constrained")
    axes = figure.subplots()
    for color, use in zip(PALETTE, chosen, strict=False):
        for way in use.ways:
            axes.plot(way[:, 0], way[:, 1], color=color, linewidth=3.0, alpha=0.3, solid_capstyle="butt")
        axes.plot([], [], color=color, linewidth=4, label=shortened(history.name_of(use.object_id), 22))
        track = facts.tracks[use.object_id]
        if track is None:
            continue
        rows = track.states["position"][:: -(-len(track.time) // TRACK)]
        axes.plot(rows[:, 0], rows[:, 1], color=color, linewidth=1.2)
        if use.left:
            position, _, _ = track.at(np.array(use.left))
            axes.plot(position[:, 0], position[:, 1], "x", color=CONTACT, markersize=8, markeredgewidth=2)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("m")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(0.0, -0.12), ncols=1 if size.narrow else 3)
    return figure


def plan_caption(history: History) -> str:
    """Return what the figure shows, and how many objects left their plans."""
    left = sum(use.times_left > 0 for use in history.plans)
    out = len(history.plans) - DRAWN
    more = f" Only {DRAWN} of the objects, those that left theirs most often first; {out} more left out." * (out > 0)
    return (
        "Planned ways, broad, the last ones of each object; driven ways, thin; a cross where an object left its plan. "
        f"{left} of {len(history.plans)} objects with plans left theirs.{more}"
    )


def plan_table(history: History) -> str:
    """Return the objects that left their plans as an HTML table; empty without any."""
    chosen = [use for use in _worst(history) if use.times_left]
    if not chosen:
        return ""
    rows = "\n".join(
        f"<tr><td><bdi>{escape(history.name_of(use.object_id))}</bdi></td>"
        f'<td class="number">{use.count}</td><td class="number">{use.times_left}</td><td>{_times(use)}</td></tr>'
        for use in chosen[:ROWS]
    )
    out = f"<p>The first {ROWS}; {len(chosen) - ROWS} more left out.</p>" if len(chosen) > ROWS else ""
    head = '<tr><th>object</th><th class="number">plans</th><th class="number">left</th><th>at (s)</th></tr>'
    return f'<div class="scroll"><table>\n{head}\n{rows}\n</table></div>{out}'


def _times(use: PlanUse) -> str:
    found = ", ".join(f"{time:.3f}" for time in use.left[:LISTED])
    return f"{found} and more" if use.times_left > LISTED else found


def _worst(history: History) -> list[PlanUse]:
    return sorted(history.plans, key=lambda use: (-use.times_left, use.object_id))
