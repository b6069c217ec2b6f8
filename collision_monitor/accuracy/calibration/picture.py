"""Picture of a calibration: the errors of the models, and how those of the chosen one grow, by class."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from collision_monitor.accuracy.calibration.calibration import LEADS, RADII, ClassCalibration

MOST_CLASSES: Final = 12
"""Classes that are drawn, those with the most states."""


def draw_calibration(found: list[ClassCalibration], path: Path) -> None:
    """Draw one panel for each class to a file. Raises OSError."""
    shown = sorted(found, key=lambda each: (-each.states, each.name))[:MOST_CLASSES]
    columns = min(len(shown), 3)
    rows = -(-len(shown) // columns)
    figure = Figure(figsize=(4.5 * columns, 3.8 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False)
    for panel in panels.flat[len(shown) :]:
        panel.remove()
    times = np.linspace(0.0, LEADS[-1], 60)
    for panel, each in zip(panels.flat, shown, strict=False):
        for model in each.models:
            chosen = model is each.chosen
            panel.plot(
                LEADS, model.held_out, "o-", linewidth=2.5 if chosen else 1.0, alpha=1.0 if chosen else 0.6,
                label=f"{model.candidate}{' (chosen)' if chosen else ''}",
            )  # fmt: skip
        one = np.array([each.growth.after(float(t)) for t in times])
        panel.fill_between(times, 0.0, RADII[each.axes] * one, color="0.85", zorder=0, label="95 % as fitted")
        best = max(max(model.held_out) for model in each.models if model.held_out[-1] <= 3.0 * each.chosen.held_out[-1])
        panel.set(title=f"{each.name} ({each.objects})", xlabel="s ahead", ylabel="RMS error, second half (m)")
        panel.set_ylim(0.0, 1.15 * max(best, RADII[each.axes] * float(one[-1]), 1e-6))
        panel.legend(fontsize=7, loc="upper left")
    figure.savefig(path, dpi=130, facecolor="white")
