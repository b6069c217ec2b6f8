"""Pictures of Pareto fronts: time per step against the error of the time and of the distance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from collision_monitor.accuracy.tuning.front import Front, error_of

MARKS: Final = {"fast": "v", "balanced": "s", "exact": "D"}
COLOURS: Final = ("#1f6fb4", "#d1571f", "#3a923a")
QUANTITIES: Final = {
    "time": ("99 % error of the time (s)", 1e-9),
    "distance": ("99 % error of the distance (m)", 1e-7),
}
"""Name of each axis, and the value at which an error of zero is drawn."""


class Peer(NamedTuple):
    """One setting of another system. error: "time" or "distance"; value: s or m; step_ms: for the same pairs."""

    name: str
    error: str
    value: float
    step_ms: float


def draw_fronts(
    columns: Mapping[str, Sequence[Front]],
    path: Path,
    peers: Mapping[str, Sequence[Peer]] | None = None,
    chosen: str | None = None,
) -> None:
    """Draw a column of two panels for each title, with the fronts of its scenes. Raises OSError.

    peers: of each column, drawn beside the fronts. chosen: name of a profile to mark.
    """
    peers = peers or {}
    tried = {row.profile for fronts in columns.values() for front in fronts for row in front.rows}
    marks = {name: mark for name, mark in (MARKS | {chosen: "*"}).items() if name in tried}
    names = list(dict.fromkeys(peer.name for each in peers.values() for peer in each))
    style: Any = {"font.size": 10, "axes.spines.top": False, "axes.spines.right": False}
    with mpl.rc_context(style):
        size = max(1.2 + 3.6 * len(columns), 6.4), 7.4 + (0.35 if names else 0.0)
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(2, len(columns), squeeze=False)
        for k, (title, fronts) in enumerate(columns.items()):
            for panel, quantity in zip(panels[:, k], QUANTITIES, strict=True):
                _draw(panel, fronts, quantity, marks)
                _draw_peers(panel, [each for each in peers.get(title, ()) if each.error == quantity], names)
            panels[0, k].set_title(title)
        for panel in panels[:, 0]:
            panel.set_ylabel("ms per step")
        most = max(len(fronts) for fronts in columns.values())
        columns_of = 2 if len(columns) == 1 else 5
        labels = next(fronts for fronts in columns.values() if len(fronts) == most)
        handles = _legend(labels, names, marks)
        figure.legend(handles=handles, loc="outside lower center", ncols=columns_of, frameon=False)
        figure.savefig(path, dpi=110)


def _draw(panel: Any, fronts: Sequence[Front], quantity: str, marks: Mapping[str, str]) -> None:
    text, least = QUANTITIES[quantity]
    panel.set(xlabel=text)
    if all(error_of(row, quantity) != error_of(row, quantity) for front in fronts for row in front.rows):
        panel.text(0.5, 0.5, "no answers to compare", ha="center", transform=panel.transAxes)
        return
    for front, colour in zip(fronts, COLOURS, strict=False):
        rows = [row for row in front.rows if error_of(row, quantity) == error_of(row, quantity)]
        place = {row.profile: max(error_of(row, quantity), least) for row in rows}
        plain = [row for row in rows if row.profile not in marks]
        best = front.best(quantity)
        for draw, shown, style in (
            (panel.scatter, plain, {"s": 13, "alpha": 0.45, "lw": 0}),
            (panel.plot, best, {"lw": 1.3, "alpha": 0.8}),
        ):
            draw([place[row.profile] for row in shown], [row.step_ms for row in shown], color=colour, **style)
        for row in rows:
            if row.profile in marks:
                mark = marks[row.profile]
                at = place[row.profile], row.step_ms
                panel.scatter(*at, s=58, marker=mark, color=colour, edgecolor="black", zorder=3)
    panel.set(xscale="log", yscale="log")
    panel.grid(alpha=0.25, which="major")
    panel.yaxis.set_minor_formatter(NullFormatter())
    low, high = panel.get_ylim()
    if high < 10.0 * low:  # so that no panel makes much of a small difference
        panel.set_ylim(low / 2.0, high * 2.0)


def _draw_peers(panel: Any, peers: Sequence[Peer], names: Sequence[str]) -> None:
    for peer in peers:
        _, least = QUANTITIES[peer.error]
        shape = _peer_mark(names, peer.name)
        panel.scatter(max(peer.value, least), peer.step_ms, s=42, marker=shape, color="#777777", zorder=2)


def _peer_mark(names: Sequence[str], name: str) -> str:
    return ("x", "+", "1", "2", "*", "^", "<", ">")[names.index(name) % 8]


def _legend(fronts: Sequence[Front], names: Sequence[str], marks: Mapping[str, str]) -> list[Line2D]:
    found = []
    for front, colour in zip(fronts, COLOURS, strict=False):
        noise = front.rows[0].noise
        label = f"front, states ± {noise:g}" if noise else "front, true states" if len(fronts) > 1 else "front"
        found.append(Line2D([], [], color=colour, marker="o", ms=4, label=label))
    for name, mark in marks.items():
        found.append(Line2D([], [], color="white", marker=mark, ms=8, markeredgecolor="black", label=name))
    for name in names:
        found.append(Line2D([], [], color="#777777", marker=_peer_mark(names, name), ls="", ms=7, label=name))
    return found
