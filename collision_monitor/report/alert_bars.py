"""The alerts of a session over time: a figure with a bar for each pair and rule, and a table of the changes."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Final

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from collision_monitor.alerts.thresholds import LEVELS
from collision_monitor.report.rendering import Size
from collision_monitor.session.history.history import History
from collision_monitor.settings.names import shortened

COLOURS: Final = ("#d9b61c", "#e0812a", "#c0302b")
"""Of the levels, from the lowest on."""

ROWS: Final = 16
"""Largest number of pairs in the figure."""

CHANGES: Final = 200
"""Largest number of changes in the table."""

Key = tuple[str, int, int]
Span = tuple[float, float, int]


def spans(history: History) -> dict[Key, list[Span]]:
    """Return for each rule and pair the times in which its alert was raised: begin, end (s) and level."""
    found: dict[Key, list[Span]] = {}
    open_since: dict[Key, tuple[float, int]] = {}
    for time, alert in history.alerts:
        key = alert.rule, alert.id_a, alert.id_b
        if key in open_since:
            found.setdefault(key, []).append((open_since[key][0], time, open_since.pop(key)[1]))
        if alert.level:
            open_since[key] = time, alert.level
    for key, (begin, level) in open_since.items():
        found.setdefault(key, []).append((begin, history.duration, level))
    return found


def alert_figure(history: History, size: Size) -> Figure | None:
    """Draw when each alert was raised, and how high; None without alerts."""
    raised = spans(history)
    if not raised:
        return None
    rows = sorted(_worst(raised)[:ROWS], key=lambda key: (raised[key][0][0], key))
    figure = Figure(figsize=(size.width, 0.9 + (0.46 if size.narrow else 0.3) * len(rows)), layout="constrained")
    axes = figure.subplots()
    shortest = history.duration / 500.0
    for row, key in enumerate(rows):
        for begin, end, level in raised[key]:
            bar = [(begin, max(end - begin, shortest))]
            axes.broken_barh(bar, (row - 0.3, 0.6), color=COLOURS[level - 1], linewidth=0)
    names = [_name(history, key) for key in rows]
    if size.narrow:
        axes.set_yticks([])
        for row, name in enumerate(names):
            axes.text(0.0, row - 0.46, name, fontsize=8, va="center", ha="left")
        axes.set_ylim(len(rows) - 0.4, -0.8)
    else:
        axes.set_yticks(range(len(rows)), names, fontsize=9)
        axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(0.0, history.duration or 1.0)
    axes.set_xlabel("s from the first step")
    handles = [Patch(color=colour, label=name) for colour, name in zip(COLOURS, LEVELS, strict=True)]
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles))
    return figure


def alert_caption(history: History) -> str:
    """Return how many alerts there were, by rule."""
    raised = spans(history)
    rules = [each.name for each in history.rules.rules] or sorted({key[0] for key in raised})
    counts = []
    for rule in rules:
        begins = [alert.level for _, alert in history.alerts if alert.rule == rule and not alert.previous_level]
        counts.append(f"{rule} {len(begins)}")
    left = len(raised) - ROWS
    out = f" The figure has the {ROWS} pairs with the highest and longest alerts." if left > 0 else ""
    return f"Alerts that were raised, by rule: {', '.join(counts)}.{out}"


def alert_table(history: History) -> str:
    """Return the changes of alerts as an HTML table."""
    rows = [
        f'<tr><td class="number">{time:.3f}</td><td>{_level(alert.previous_level)} → {_level(alert.level)}</td>'
        f"<td>{escape(alert.rule)}</td><td><bdi>{escape(alert.text)}</bdi></td></tr>"
        for time, alert in history.alerts[:CHANGES]
    ]
    left = len(history.alerts) - CHANGES
    out = f"<p>The first {CHANGES}; {left} more left out.</p>" if left > 0 else ""
    head = '<tr><th class="number">s</th><th>level</th><th>rule</th><th>why</th></tr>\n'
    return f'<div class="scroll"><table>\n{head}' + "\n".join(rows) + f"\n</table></div>{out}"


def _level(level: int) -> str:
    return LEVELS[level - 1] if level else "none"


def _name(history: History, key: Key) -> str:
    pair = " – ".join(shortened(history.name_of(object_id), 14) for object_id in dict.fromkeys(key[1:]))
    return f"{pair} ({shortened(key[0], 12)})"


def _worst(raised: dict[Key, list[Span]]) -> list[Key]:
    """Return the keys by their highest level and the time at it, the worst first."""

    def rank(key: Key) -> tuple[int, float, Key]:
        highest = max(level for *_, level in raised[key])
        return -highest, -_total(end - begin for begin, end, level in raised[key] if level == highest), key

    return sorted(raised, key=rank)


def _total(lengths: Iterable[float]) -> float:
    return sum(lengths)
