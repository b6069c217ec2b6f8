"""The pictures of a report, drawn with matplotlib."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any, Final

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from collision_monitor.geometry.reach import reach
from collision_monitor.report.facts import Facts, pair_distance, track
from collision_monitor.session.history import Collision, History, Pair

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CONTACT, WARNING, POSSIBLE, INK = "#c0392b", "#e69f00", "#8a8a8a", "#1f4e79"
PALETTE: Final = ("#1f4e79", "#c0392b", "#2a8c4a", "#8e44ad", "#e69f00", "#555555")

PAIRS: Final = 16
"""Rows of the timeline."""
CLOSEST: Final = 4
"""Pairs whose distance is drawn."""
EVENTS: Final = 6
"""Collisions that are drawn from above."""
AROUND: Final = 2.0
"""s of the tracks that are drawn before and after a collision."""
OUTLINE: Final = 48
"""Directions from which a footprint is looked at."""

STYLE: Final[Any] = {
    "font.size": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 12,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "collision_monitor",
    "text.parse_math": False,  # a name may hold a dollar sign
}


def figures(history: History, facts: Facts) -> dict[str, Figure]:
    """All pictures for which there is something to draw, by name, in their order on the page."""
    with mpl.rc_context(STYLE):
        drawn = {
            "timeline": _timeline(history, facts),
            "predicted": _predicted(history, facts),
            "distances": _distances(history, facts),
            "events": _events(history, facts),
            "steps": _steps(history),
        }
    return {name: figure for name, figure in drawn.items() if figure is not None}


def as_svg(figure: Figure) -> str:
    """The picture as an SVG element; the same bytes for the same picture."""
    buffer = BytesIO()
    with mpl.rc_context(STYLE):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue().decode()
    return text[text.index("<svg") :]


def as_png(figure: Figure) -> bytes:
    """The picture as PNG."""
    buffer = BytesIO()
    with mpl.rc_context(STYLE):
        figure.savefig(buffer, format="png", dpi=130, metadata={"Software": None})
    return buffer.getvalue()


def pair_name(history: History, pair: Pair) -> str:
    """Both names, shortened to what fits on a picture."""
    return " – ".join(name if len(name) <= 16 else f"{name[:15]}…" for name in map(history.name_of, pair))


def _runs(times: NDArray[np.float64], period: float) -> list[tuple[float, float]]:
    """Begin and length of the stretches of times without a gap of over 1.5 periods."""
    breaks = np.flatnonzero(np.diff(times) > 1.5 * period) + 1
    return [(float(part[0]), float(part[-1] - part[0]) + period) for part in np.split(times, breaks) if len(part)]


def _timeline(history: History, facts: Facts) -> Figure | None:
    pairs = facts.risky[:PAIRS]
    if not pairs:
        return None
    figure = Figure(figsize=(9, 0.9 + 0.34 * len(pairs)), layout="constrained")
    axes = figure.subplots()
    period = float(np.median(np.diff(history.times))) if len(history.times) > 1 else 0.1
    for row, pair in enumerate(pairs):
        warning = facts.warnings.get(pair)
        if warning is not None:
            sure = warning.certain
            axes.broken_barh(_runs(warning.time[~sure], period), (row - 0.16, 0.32), color=POSSIBLE, alpha=0.5)
            axes.broken_barh(_runs(warning.time[sure], period), (row - 0.16, 0.32), color=WARNING)
        for each in (c for c in history.collisions if c.pair == pair):
            end = history.duration if each.end is None else each.end
            color = CONTACT if each.certain else POSSIBLE
            axes.broken_barh([(each.begin, max(end - each.begin, period))], (row - 0.32, 0.64), color=color)
    axes.set_yticks(range(len(pairs)), [pair_name(history, pair) for pair in pairs])
    axes.set_ylim(len(pairs) - 0.5, -0.5)
    axes.set_xlim(0.0, max(history.duration, period))
    axes.set_xlabel("s from the first step")
    marks = [(CONTACT, "in contact"), (WARNING, "predicted to touch"), (POSSIBLE, "possible, not certain")]
    handles = [mpl.patches.Patch(color=color, label=label) for color, label in marks]
    figure.legend(handles=handles, loc="outside upper right", ncols=3)
    return figure


def _predicted(history: History, facts: Facts) -> Figure | None:
    """Predicted against actual: how wrong each prediction of a collision was, by how long before it was made."""
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    axes = figure.subplots()
    drawn = False
    for color, each in zip(PALETTE * len(facts.warned), facts.warned[: len(PALETTE)], strict=False):
        warning = facts.warnings[each.pair]
        inside = (warning.time >= each.begin - each.warned - 1e-9) & (warning.time < each.begin)
        lead = each.begin - warning.time[inside]
        low, high = warning.lower[inside] - lead, warning.upper[inside] - lead
        high = np.where(np.isfinite(high), high, low)
        axes.fill_between(lead, low, high, color=color, alpha=0.3, linewidth=0)
        axes.plot(lead, low, color=color, linewidth=1.5, label=f"{pair_name(history, each.pair)}, {each.begin:.2f} s")
        drawn = True
    if not drawn:
        return None
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.invert_xaxis()
    axes.set_xlabel("s before the contact was first reported")
    axes.set_ylabel("predicted − actual (s)")
    axes.legend(fontsize=9, ncols=2)
    return figure


def _distances(history: History, facts: Facts) -> Figure | None:
    pairs = [pair for pair in facts.risky if len(pair_distance(history, pair)[0])][:CLOSEST]
    if not pairs:
        return None
    figure = Figure(figsize=(9, 5.2), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for color, pair in zip(PALETTE, pairs, strict=False):
        times, distance = pair_distance(history, pair)
        above.plot(times, distance, color=color, label=pair_name(history, pair))
        warning = facts.warnings.get(pair)
        if warning is not None:
            below.plot(warning.time, warning.lower, ".", color=color, markersize=3)
    above.axhline(0.0, color="black", linewidth=0.8)
    above.set_ylabel("distance (m)")
    above.legend(fontsize=9, ncols=2)
    below.set_ylabel("time to collision (s)")
    below.set_ylim(bottom=0.0)
    below.set_xlabel("s from the first step")
    return figure


def _events(history: History, facts: Facts) -> Figure | None:
    chosen = sorted(facts.collisions, key=lambda c: (c.deepest, c.begin))[:EVENTS]
    chosen.sort(key=lambda c: (c.begin, c.pair))
    if not chosen:
        return None
    columns = min(len(chosen), 3)
    rows = -(-len(chosen) // columns)
    figure = Figure(figsize=(9, 0.3 + 3.2 * rows), layout="constrained")
    for axes, each in zip(figure.subplots(rows, columns, squeeze=False).ravel(), [*chosen, *[None] * 3], strict=False):
        if each is None:
            axes.axis("off")
        else:
            _from_above(axes, history, each)
    return figure


def _from_above(axes: Axes, history: History, collision: Collision) -> None:
    for color, object_id in zip(PALETTE, collision.pair, strict=False):
        path = track(history, object_id)
        if path is None:
            continue
        near = (path.time >= collision.begin - AROUND) & (path.time <= collision.begin + AROUND)
        axes.plot(path.position[near, 0], path.position[near, 1], color=color, linewidth=1, alpha=0.7)
        name = history.name_of(object_id)
        axes.plot([], [], color=color, label=name if len(name) <= 14 else f"{name[:13]}…")
        described = history.objects.get(object_id)
        if described is not None:
            position, quaternion = path.at(np.array([collision.begin]))
            outline = _footprint(described.shapes, position[0], quaternion[0])
            if outline is not None:
                axes.fill(outline[:, 0], outline[:, 1], color=color, alpha=0.35, linewidth=0)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(f"{collision.begin:.2f} s", fontsize=10)
    axes.legend(fontsize=8, loc="upper left", handlelength=1)
    axes.tick_params(labelsize=8)


def _footprint(
    shapes: Any, position: NDArray[np.float64], quaternion: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """The convex outline (n, 2) of an object seen from above; None for one without an end."""
    from collision_monitor.geometry.pose import Pose

    pose = Pose((0.0, 0.0, 0.0), quaternion)
    angle = np.linspace(0.0, 2.0 * np.pi, OUTLINE, endpoint=False)
    normal = np.stack([np.cos(angle), np.sin(angle), np.zeros(OUTLINE)], axis=1)
    far = reach([(shape, pose @ offset) for shape, offset in shapes], normal)
    if not np.isfinite(far).all():
        return None
    # corners: where neighbouring lines of sight meet
    after_normal, after = np.roll(normal, -1, axis=0), np.roll(far, -1)
    area = normal[:, 0] * after_normal[:, 1] - normal[:, 1] * after_normal[:, 0]
    x = (far * after_normal[:, 1] - after * normal[:, 1]) / area
    y = (after * normal[:, 0] - far * after_normal[:, 0]) / area
    return np.stack([x, y], axis=1) + position[:2]


def _steps(history: History) -> Figure | None:
    if not len(history.durations):
        return None
    milliseconds = history.durations * 1e3
    figure = Figure(figsize=(9, 2.6), layout="constrained")
    axes = figure.subplots()
    axes.hist(milliseconds, bins=min(40, max(5, len(milliseconds) // 3)), color=INK)
    p99 = float(np.quantile(milliseconds, 0.99))
    axes.axvline(p99, color=CONTACT, linewidth=1.5)
    axes.set_title(f"99 % within {p99:.3g} ms", color=CONTACT, fontsize=10)
    axes.set_xlabel("ms from a message to its answers")
    axes.set_ylabel("steps")
    return figure
