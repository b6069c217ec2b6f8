"""The table and the picture of benchmarks/guard_encounters.py."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

LATE = 0.15
"""s: most time between two ticks of a simulation that counts as real time."""

FRESH = 0.25
"""s: the guard stops for answers older than 0.3 s."""


def _by_fault(done: Iterable[Any]) -> dict[str, list[Any]]:
    """Return the outcomes by fault; those without a fault in which the crate appears come last."""
    found: dict[str, list[Any]] = {}
    for each in sorted(done, key=lambda one: (not one.stops, one.fault)):
        if each.scene != "passes":
            found.setdefault(each.fault, []).append(each)
    return found


def _times(values: Sequence[float | None]) -> str:
    known = [each for each in values if each is not None]
    return f"{np.median(known):.2f}, {max(known):.2f}" if known else "-"


def shows(outcome: Any) -> bool:
    """Return whether an encounter took place: in real time, with a robot that drove when the fault began."""
    drove = outcome.scene == "passes" or outcome.met_at > 0.01
    return bool(drove and outcome.lag <= LATE and np.isfinite(outcome.margin))


def table(done: Sequence[Any]) -> list[str]:
    """Return the lines of a table in Markdown, and the figures below it."""
    played, done = done, [each for each in done if shows(each)]
    lines = [
        "| Fault | encounters | to the command to stop: median, most (s) | to standstill: median, most (s) | held "
        "| nearest (m) | least of distance − braking distance (m) |",
        "|---|---|---|---|---|---|---|",
    ]
    for fault, some in _by_fault(done).items():
        stood = [each for each in some if each.stood is not None]
        held = f"{sum(not e.broke for e in stood)} of {len(some)}" if some[0].stops else "-"
        lines.append(
            f"| {fault} | {len(some)} | {_times([e.commanded for e in some])} | {_times([e.stood for e in some])} "
            f"| {held} | {min(e.nearest for e in some):.2f} "
            f"| {min(e.margin for e in some):.2f} |"
        )
    bad = [each for each in done if each.margin < 0.0]
    late = sum(each.lag > LATE for each in played)
    lines += ["", f"left out: {late} encounters whose simulation was late by more than {LATE} s, and"]
    lines += [f"{len(played) - len(done) - late} in which the robot already stood, because the machine was late before"]
    lines += [f"{len(done)} encounters; nearer than the braking distance: {len(bad)}"]
    lines += [f"  {e.fault}, {e.scene}: {e.margin:.3f} m, contact at {e.contact:.2f} m/s: {e.said}" for e in bad]
    moved = [each for each in done if each.stops and each.stood is None]
    lines.append(f"did not stand because of the fault: {len(moved)} {[each.fault for each in moved] or ''}")
    lines += _needless(done)
    slow = [each for each in done if each.recovered is None]
    lines.append(f"to passing again after the fault: {_times([e.recovered for e in done])} s; never: {len(slow)}")
    return lines


def _needless(done: Sequence[Any]) -> list[str]:
    """Return the figures of stops before a fault, or without one. Late answers are a fault of the machine itself.

    Before a crate that walks at the robot a stop is not needless.
    """
    lines, done = [], [each for each in done if each.scene != "walks"]
    for words, some in (
        ("the answers never older than 0.25 s", [each for each in done if each.oldest <= FRESH]),
        ("answers older than that, because the machine was busy", [each for each in done if each.oldest > FRESH]),
    ):
        stopped = [each for each in some if each.needless]
        share = 100.0 * len(stopped) / max(len(some), 1)
        beside = [each for each in some if each.scene == "passes"]
        passes = sum(each.needless > 0 for each in beside)
        lines.append(
            f"needless stops before a fault, {words}: {len(stopped)} of {len(some)} ({share:.1f} %); "
            f"of these beside the lane, without a fault: {passes} of {len(beside)}"
        )
        lines += [f"  {each.fault}, {each.oldest:.2f} s: {each.why_needless}" for each in stopped]
    return lines


def draw(done: Sequence[Any], path: Path) -> None:
    """Draw the time to standstill and the least distance beyond the braking distance, one dot for each encounter."""
    done = [each for each in done if shows(each)]
    from matplotlib.figure import Figure

    rows = list(_by_fault(done).items())[::-1]
    figure = Figure(figsize=(9.6, 6.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    generator = np.random.default_rng(0)
    for k, (_, some) in enumerate(rows):
        jitter = generator.uniform(-0.25, 0.25, len(some))
        stood = np.array([np.nan if e.stood is None else e.stood for e in some])
        told = np.array([np.nan if e.commanded is None else e.commanded for e in some])
        left.scatter(told, k + jitter, s=9, color="#3b82c4", label="command to stop" if k == 0 else None)
        left.scatter(stood, k + jitter, s=9, color="#d1493f", label="standstill" if k == 0 else None)
        margins = [e.margin if np.isfinite(e.margin) else np.nan for e in some]
        right.scatter(margins, k + jitter, s=9, color="#2e9e5b")
    left.set_yticks(range(len(rows)), [f"{fault} ({len(some)})" for fault, some in rows])
    left.set_xlabel("s after the fault\n(last two rows: after a crate appears ahead)")
    left.legend(frameon=False, fontsize=9, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    right.axvline(0.0, color="#c0302b", linewidth=1.0, linestyle="--")
    right.set_xlabel("least of distance to the crate\nless braking distance, m")
    left.set_xlim(0.0)
    right.set_xlim(min(0.0, right.get_xlim()[0]) - 0.05)
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(axis="x", color="#dddddd", linewidth=0.6)
        axes.set_axisbelow(True)
    figure.savefig(path, dpi=150, metadata={"Software": None})
