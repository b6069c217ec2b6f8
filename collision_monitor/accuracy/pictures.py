"""Figures of the measurements as image files: time against error, and errors over each sweep."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure

from collision_monitor.accuracy.extremes import SWEEPS, WorstCase
from collision_monitor.accuracy.tradeoff.measurement import Measurement, labels_of_models

MOST_IN_LEGEND: Final = 4
"""Largest number of points that a panel names within its axes. A longer legend stands beside the panel."""


def draw_tradeoff(rows: Sequence[Measurement], path: Path) -> None:
    """Draw time against error, one panel per scene. Raises OSError."""
    scenes = list(dict.fromkeys(row.label for row in rows))
    of_models = labels_of_models(rows)
    columns = min(len(scenes), 3)
    lines = -(-len(scenes) // columns)
    figure = Figure(figsize=(4.0 * columns, 3.6 * lines), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False)
    for panel in panels.flat[len(scenes) :]:
        panel.remove()
    for panel, scene in zip(panels.flat, scenes, strict=False):
        if scene in of_models:
            _draw_models(panel, scene, [row for row in rows if row.label == scene])
            continue
        shown = [row for row in rows if row.label == scene and row.ttc_error_s.p99 > 0.0]
        panel.set(title=scene, xlabel="p99 error of the time to collision (s)", ylabel="ms per step")
        if not shown:
            panel.text(0.5, 0.5, "nothing predicted", ha="center", transform=panel.transAxes)
            continue
        for row in shown:
            panel.scatter(row.ttc_error_s.p99, row.step_ms, s=60, label=row.profile)
        times = [row.step_ms for row in shown]
        if max(times) > 5.0 * min(times):
            panel.set(xscale="log", yscale="log", ylim=(0.5 * min(times), 2.0 * max(times)))
        else:
            panel.set(xscale="log", ylim=(0.0, 1.5 * max(times)))
        if len(shown) <= MOST_IN_LEGEND:
            panel.legend(loc="lower left")
        else:
            panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7)
        panel.grid(alpha=0.3)
        panel.tick_params(axis="x", which="both", labelrotation=30)  # beside each other, the minor ones overlap
    figure.savefig(path, dpi=120)


def _draw_models(panel: Any, scene: str, rows: Sequence[Measurement]) -> None:
    """Draw time against the error of the distance, both on logarithmic scales."""
    panel.set(title=scene, xlabel="worst error of the distance (m)", ylabel="ms per step", yscale="log")
    panel.set_xscale("symlog", linthresh=1e-3)  # the exact shapes have no error
    for row in rows:
        panel.scatter(row.distance_error_m, row.step_ms, s=60, label=row.model)
    panel.legend(loc="upper right")
    panel.grid(alpha=0.3)


def draw_extremes(rows: Sequence[WorstCase], path: Path) -> None:
    """Draw the errors over the varied quantity, one panel per sweep. Raises OSError."""
    names = list(SWEEPS)
    with mpl.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(13, 6.2), layout="constrained")
        panels = figure.subplots(2, (len(names) + 1) // 2, sharey=True).ravel()
        for axes, name in zip(panels, names, strict=False):
            for row in (row for row in rows if row.sweep == name):
                x = [value or min(v for v in row.curve if v) / 10 for value in row.curve]
                axes.plot(x, [max(error, 1e-18) for error in row.curve.values()], ".-", label=row.quantity, linewidth=1)
            unit = SWEEPS[name][0]
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlabel(f"{name} ({unit})" if unit else name)
            axes.axhline(2.2e-16, color="black", linewidth=0.6, linestyle=":")
        for axes in panels[:: len(panels) // 2]:
            axes.set_ylabel("worst relative error")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=6)
        figure.savefig(path, dpi=110)
