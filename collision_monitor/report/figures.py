"""Figures of a report, drawn from its facts with matplotlib."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from collision_monitor.report.alert_bars import alert_figure
from collision_monitor.report.facts import ReportFacts
from collision_monitor.report.from_above import from_above
from collision_monitor.report.plans_from_above import plan_figure
from collision_monitor.report.rendering import CONTACT, INK, PALETTE, POSSIBLE, WARNING, Size, styled
from collision_monitor.session.history.alerts import stated_error
from collision_monitor.session.history.history import CollisionEvent, Floats, History, Pair
from collision_monitor.settings.names import shortened

PAIRS: Final = 16
"""Largest number of rows of the timeline."""
CLOSEST: Final = 4
"""Largest number of pairs whose distance is drawn."""
CURVES: Final = 6
"""Largest number of collisions whose predictions are drawn."""
DOTS: Final = 2000
"""Largest number of predictions of one pair that are drawn."""
NEAR: Final = 0.5
"""m: distances up to this one are drawn to scale, and larger ones on a logarithmic scale beyond."""
FINEST: Final = 1000
"""Number of parts of the timeline. Predictions within about one part are drawn as one bar."""
BINS: Final = 40
TAIL: Final = 0.995
"""Quantile of the step times at which the histogram ends. Its last bar includes all longer times."""


def figures(history: History, facts: ReportFacts, size: Size) -> dict[str, Figure]:
    """Draw the figures that have content. Return them by name, in their order on the page."""
    draw: dict[str, Callable[[History, ReportFacts, Size], Figure | None]] = {
        "timeline": _timeline,
        "alerts": lambda history, _, size: alert_figure(history, size),
        "predicted": _predicted,
        "distances": _distances,
        "events": from_above,
        "plans": plan_figure,
        "steps": lambda history, _, size: _steps(history, size),
    }
    with styled():
        drawn = {name: function(history, facts, size) for name, function in draw.items()}
    return {name: figure for name, figure in drawn.items() if figure is not None}


def pair_name(history: History, pair: Pair, longest: int = 18) -> str:
    """Return both names of a pair, shortened to fit into a figure."""
    return " – ".join(shortened(history.name_of(object_id), longest) for object_id in pair)


def drawn_collisions(facts: ReportFacts) -> list[CollisionEvent]:
    """Return the collisions to draw: those with the largest errors, then those with the longest warning."""
    chosen = sorted(facts.answered, key=lambda c: (-_worst(facts, c), -c.warned, c.begin, c.pair))[:CURVES]
    return sorted(chosen, key=lambda c: (c.begin, c.pair))


def largest_error(facts: ReportFacts) -> float:
    """Return the largest error of the stated intervals of all predicted collisions (s), or 0 without any."""
    return max((_worst(facts, each) for each in facts.answered), default=0.0)


def _worst(facts: ReportFacts, collision: CollisionEvent) -> float:
    return float(np.abs(stated_error(facts.answered[collision], collision, facts.period)).max())


def _runs(times: Floats, longest: float, period: float) -> list[tuple[float, float]]:
    """Return begin and length of the runs of times without a gap longer than `longest`."""
    breaks = np.flatnonzero(np.diff(times) > longest) + 1
    return [(float(part[0]), float(part[-1] - part[0]) + period) for part in np.split(times, breaks) if len(part)]


def _timeline(history: History, facts: ReportFacts, size: Size) -> Figure | None:
    pairs = facts.risky[:PAIRS]
    if not pairs:
        return None
    of_pair: dict[Pair, list[CollisionEvent]] = {pair: [] for pair in pairs}
    for each in history.collisions:
        if each.pair in of_pair:
            of_pair[each.pair].append(each)
    pairs.sort(key=lambda pair: (min([c.begin for c in of_pair[pair]], default=np.inf), pair))
    figure = Figure(figsize=(size.width, 0.9 + (0.46 if size.narrow else 0.3) * len(pairs)), layout="constrained")
    axes = figure.subplots()
    for begin, end in facts.gaps:
        axes.axvspan(begin, end, facecolor="none", edgecolor=POSSIBLE, hatch="////", linewidth=0, alpha=0.6)
    shortest = max(facts.period, history.duration / FINEST)
    reach = 0.26 if size.narrow else 0.42
    for row, pair in enumerate(pairs):
        for certain, color in ((False, POSSIBLE), (True, WARNING)):
            times = [alert.time for alert in facts.alerts.get(pair, ()) if alert.certain == certain]
            if times:
                runs = _runs(np.concatenate(times), 1.5 * shortest, shortest)
                axes.broken_barh(runs, (row - 0.3 * reach, 0.6 * reach), color=color, linewidth=0)
        for each in of_pair[pair]:
            end = each.last if each.end is None else each.end
            color = CONTACT if each.certain else POSSIBLE
            bar = (each.begin, max(end - each.begin, shortest))
            axes.broken_barh([bar], (row - 0.7 * reach, 1.4 * reach), color=color, linewidth=0)
            if each in facts.answered:
                low, high = facts.answered[each].first_stated
                stated = [low, high] if np.isfinite(high) else [low]
                axes.vlines(stated, row - reach, row + reach, color=INK, linewidth=0.9)
    if size.narrow:  # the names are above the bars, because there is no room beside them
        axes.set_yticks([])
        axes.spines["left"].set_visible(False)
        for row, pair in enumerate(pairs):
            axes.text(0.0, row - 0.46, pair_name(history, pair), fontsize=8, va="center", ha="left")
        axes.set_ylim(len(pairs) - 0.4, -0.8)
    else:
        axes.set_yticks(range(len(pairs)), [pair_name(history, pair) for pair in pairs], fontsize=9)
        axes.set_ylim(len(pairs) - 0.5, -0.5)
    axes.set_xlim(0.0, max(history.duration, shortest) or 1.0)
    axes.set_xlabel("s from the first step")
    handles: list[Patch | Line2D] = [Patch(color=CONTACT, label="in contact"), Patch(color=WARNING, label="predicted")]
    if facts.answered:
        mark = Line2D([], [], color=INK, marker="|", markersize=10, linestyle="", label="first stated time")
        handles.append(mark)
    if facts.possible or any(not alert.certain for pair in pairs for alert in facts.alerts.get(pair, ())):
        handles.append(Patch(color=POSSIBLE, label="possible"))
    if facts.gaps:
        handles.append(Patch(facecolor="none", edgecolor=POSSIBLE, hatch="////", label="no steps"))
    _legend(figure, handles, 2 if size.narrow else len(handles))
    return figure


def _compress(axes: Axes, threshold: float, steps: tuple[int, ...]) -> None:
    """Draw y to scale up to the threshold and logarithmically beyond, with ticks at 0 and at steps of each decade."""
    axes.set_yscale("symlog", linthresh=threshold)
    low, high = axes.get_ylim()
    ticks = [0.0, *(sign * step * 10.0**k for sign in (-1, 1) for k in range(-3, 10) for step in steps)]
    axes.set_yticks([tick for tick in ticks if not tick or (abs(tick) >= threshold and low <= tick <= high)])
    axes.yaxis.set_major_formatter("{x:g}")


def _legend(figure: Figure, handles: list[Patch | Line2D], columns: int) -> None:
    figure.legend(handles=handles, loc="outside upper left", ncols=columns, columnspacing=1.2)


def _predicted(history: History, facts: ReportFacts, size: Size) -> Figure | None:
    """Draw the error of each prediction of a collision over the time before the contact."""
    chosen = drawn_collisions(facts)
    if not chosen:
        return None
    figure = Figure(figsize=(size.width, 4.0 if size.narrow else 3.0), layout="constrained")
    axes = figure.subplots()
    axes.axhspan(-1e3 * facts.period, 0.0, color=POSSIBLE, alpha=0.25, linewidth=0)
    handles: list[Patch | Line2D] = []
    for color, each in zip(PALETTE, chosen, strict=False):
        alert = facts.answered[each]
        before = alert.time < each.begin
        lead = each.begin - alert.time[before]
        low, high = 1e3 * (alert.lower[before] - lead), 1e3 * (alert.upper[before] - lead)
        every = slice(None, None, -(-len(lead) // DOTS))
        lead, low, high = lead[every], low[every], np.where(np.isfinite(high), high, low)[every]
        axes.fill_between(lead, low, high, color=color, alpha=0.2, linewidth=0)
        axes.plot(lead, low, color=color, linewidth=1.5)
        name = f"{pair_name(history, each.pair, 14 if size.narrow else 18)}, {each.begin:.2f} s"
        handles.append(Line2D([], [], color=color, label=name))
    axes.invert_xaxis()
    axes.set_xlabel("s before the contact was first reported")
    axes.set_ylabel("predicted − actual (ms)")
    # to scale within a few steps and logarithmic beyond, so that one early guess does not flatten all other curves
    _compress(axes, max(5e3 * facts.period, 1.0), steps=(1,))
    handles.append(Patch(color=POSSIBLE, alpha=0.4, label="within the step in which the contact began"))
    _legend(figure, handles, 1 if size.narrow else 2)
    return figure


def _distances(history: History, facts: ReportFacts, size: Size) -> Figure | None:
    curves: list[tuple[Pair, tuple[Floats, Floats]]] = []
    for pair in facts.risky:
        if len(curves) == CLOSEST:
            break
        curve = facts.tracks.distance(pair)
        if curve is not None and np.isfinite(curve[1]).any():
            curves.append((pair, curve))
    if not curves:
        return None
    figure = Figure(figsize=(size.width, 4.8 if size.narrow else 4.4), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    handles: list[Patch | Line2D] = []
    for color, (pair, (times, distance)) in zip(PALETTE, curves, strict=False):
        above.plot(times, distance, color=color, linewidth=1.5)
        for alert in facts.alerts.get(pair, ()):
            every = slice(None, None, -(-len(alert.time) // DOTS))
            below.plot(alert.time[every], alert.lower[every], color=color, linewidth=1.5, marker=".", markersize=2)
        handles.append(Line2D([], [], color=color, label=pair_name(history, pair, 14 if size.narrow else 18)))
    low = min(0.0, *(float(np.nanmin(distance)) for _, (_, distance) in curves))
    above.axhspan(1.1 * low, 0.0, color=CONTACT, alpha=0.12, linewidth=0)
    above.axhline(0.0, color=INK, linewidth=0.8)
    above.set_ylabel("distance (m)")
    _compress(above, NEAR, steps=(1, 2, 5))
    below.set_ylabel("time to\ncollision (s)")
    below.set_ylim(0.0, 1.05 * history.profile.horizon)
    below.set_xlim(0.0, max(history.duration, facts.period) or 1.0)
    below.set_xlabel("s from the first step")
    _legend(figure, handles, 1 if size.narrow else 2)
    return figure


def _steps(history: History, size: Size) -> Figure | None:
    if not len(history.durations):
        return None
    milliseconds = history.durations * 1e3
    middle, p99, longest = np.quantile(milliseconds, [0.5, 0.99, 1.0])
    last = max(float(np.quantile(milliseconds, TAIL)), 1e-6)
    figure = Figure(figsize=(size.width, 2.4), layout="constrained")
    axes = figure.subplots()
    axes.hist(np.minimum(milliseconds, last), bins=BINS, range=(0.0, last * 1.001), color=PALETTE[0])
    axes.axvline(p99, color=CONTACT, linewidth=1.5)
    text = [f"median {middle:.3g} ms", f"99 % within {p99:.3g} ms", f"longest {longest:.3g} ms"]
    axes.set_title((",\n" if size.narrow else ", ").join([", ".join(text[:2]), text[2]]))
    axes.set_xlabel("ms from a message to its answers")
    axes.set_ylabel("steps")
    return figure
