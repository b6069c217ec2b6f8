"""Picture of a calibration: the deviation of each model over the look-ahead, a panel for each class."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from collision_monitor.accuracy.calibration.calibrate import Calibration
from collision_monitor.accuracy.calibration.deviation import LAGS

COLOURS = {"rest": "#999999", "people": "#1f6fb4", "arc": "#d1571f", "straight": "#3a923a", "stops": "#7d4fa5"}
STYLES = {0.0: "-", 0.2: ":", 0.5: "--", 1.0: "-."}


def draw_calibration(found: Sequence[Calibration], path: Path) -> None:
    """Draw RMS deviations (m) over the look-ahead (s). Raises OSError."""
    style: Any = {"font.size": 10, "axes.spines.top": False, "axes.spines.right": False}
    with mpl.rc_context(style):
        figure = Figure(figsize=(max(6.4, 5.2 * len(found)), 4.6), layout="constrained")
        panels = figure.subplots(1, len(found), squeeze=False)[0]
        for panel, each in zip(panels, found, strict=True):
            for model, rms in each.rms.items():
                is_chosen = model == each.chosen
                panel.plot(
                    LAGS, rms, STYLES[model.window], color=COLOURS[model.motion], linewidth=2.6 if is_chosen else 1.0,
                    marker="o" if is_chosen else "", markersize=4, label=f"{model}{', chosen' if is_chosen else ''}",
                )  # fmt: skip
            lags = np.linspace(0.0, LAGS[-1], 50)
            axes = np.sqrt(2.0)  # most objects move in a plane
            panel.plot(
                lags, [axes * each.growth.at(t) for t in lags], color="0.75", linewidth=6, alpha=0.6, zorder=0,
                label="stated by the settings",
            )  # fmt: skip
            panel.set_title(f"{each.name}: {each.tracks} tracks, {each.states} states")
            panel.set_xlabel("look-ahead (s)")
            panel.set_ylim(bottom=0.0)
            panel.legend(frameon=False, fontsize=8)
        panels[0].set_ylabel("RMS deviation (m)")
        figure.savefig(path, dpi=120)
