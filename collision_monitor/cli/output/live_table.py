"""Current contacts and next collisions, as tables for a terminal and as a line for a pipe."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rich.console import Group, RenderableType
from rich.constrain import Constrain
from rich.table import Table
from rich.text import Text

from collision_monitor import codec
from collision_monitor.records import Phase, PredictionStatus

CONTACT_ROWS = 5
PREDICTION_ROWS = 10
WIDEST = 100
"""Columns of a terminal that the tables fill at most."""
"""The tables have a fixed number of rows, so that the picture does not jump."""

_RECORDING = {0: "not recording", 1: "recording", 2: "RECORDING FAILED"}


@dataclass(frozen=True)
class LatestAnswers:
    """Newest messages of the monitor, `elapsed` s after its first answer. None: no message received yet."""

    title: str
    elapsed: float
    contacts: codec.ContactArray | None
    predictions: codec.PredictedCollisionArray | None
    status: codec.MonitorStatus

    def table(self) -> RenderableType:
        """Return the tables for a terminal of 80 columns and more."""
        group = Group(
            Text(f"{self.title}  {self.elapsed:4.1f} s", style="bold"),
            self._contact_table(),
            self._prediction_table(),
            Text(self._state()),
        )
        return Constrain(group, WIDEST)

    def line(self) -> str:
        """Return the totals and the soonest predicted collision in one line."""
        line = f"{self.elapsed:4.0f} s  {self.status.contacts} touching, {self.status.predictions} predicted"
        if self.predictions is not None and len(self.predictions.predictions):
            first = self.predictions.predictions[0]
            line += f", next: {_pair(first, _names(self.predictions))} in {_time(first['lower'])}{_doubt(first)}"
        return f"{line}  ({self._state()})"

    def _contact_table(self) -> Table:
        table = _table("Touching now", ("depth", 11), ("for", 9), ("closing at", 10))
        rows = 0
        if self.contacts is not None:
            names, contacts = _names(self.contacts), self.contacts.contacts
            now = contacts[(contacts["phase"] != Phase.END) & (contacts["point_index"] == 0)]
            table.title = f"Touching now: {len(now)}"
            for contact in now[:CONTACT_ROWS]:
                table.add_row(
                    _pair(contact, names),
                    f"{-contact['signed_distance'] * 1e3:.1f} mm",
                    f"{contact['duration']:.2f} s",
                    f"{contact['closing_speed']:.2f} m/s",
                    style="red",
                )
                rows += 1
        return _padded(table, CONTACT_ROWS - rows)

    def _prediction_table(self) -> Table:
        table = _table("Next", ("in", 7), ("at the latest", 13), ("status", 10), ("closing at", 10))
        rows = 0
        if self.predictions is not None:
            names, impacts = _names(self.predictions), self.predictions.predictions
            table.title = f"Touching within {self.predictions.horizon:g} s: {len(impacts)}"
            for impact in impacts[:PREDICTION_ROWS]:
                status = PredictionStatus(int(impact["status"])).name.lower()
                table.add_row(
                    _pair(impact, names),
                    _time(impact["lower"]),
                    _time(impact["upper"]),
                    "stale" if impact["stale"] else status,
                    f"{impact['closing_speed']:.2f} m/s",
                    style="yellow" if impact["lower"] < 1.0 else "",
                )
                rows += 1
        return _padded(table, PREDICTION_ROWS - rows)

    def _state(self) -> str:
        status = self.status
        parts = [
            f"{status.objects} objects, {status.rate:.0f} Hz",
            f"latency {_milliseconds(status.latency)}",
            f"step {_milliseconds(status.step_duration)} (p99 {_milliseconds(status.step_duration_p99)})",
            f"{_RECORDING.get(status.recording, '?')}, {status.recorded_messages} messages",
        ]
        if status.objects_stale:
            parts.insert(1, f"{status.objects_stale} STALE")
        return " · ".join(parts)


def _table(title: str, *columns: tuple[str, int]) -> Table:
    table = Table(title=title, title_justify="left", expand=True)
    table.add_column("objects", ratio=1, no_wrap=True)
    for name, width in columns:
        table.add_column(name, width=width, justify="right", no_wrap=True)
    return table


def _padded(table: Table, rows: int) -> Table:
    for _ in range(rows):
        table.add_row()
    return table


def _names(message: codec.ContactArray | codec.PredictedCollisionArray) -> dict[int, str]:
    return dict(zip(message.ids.tolist(), message.names, strict=True))


def _pair(record: Any, names: dict[int, str]) -> str:
    a, b = int(record["id_a"]), int(record["id_b"])
    return f"{names.get(a, a)} – {names.get(b, b)}"


def _doubt(impact: Any) -> str:
    status = PredictionStatus(int(impact["status"]))
    return "" if status == PredictionStatus.HIT else f" ({status.name.lower()})"


def _time(seconds: float) -> str:
    return f"{seconds:.2f} s" if math.isfinite(seconds) else "not known"


def _milliseconds(seconds: float) -> str:
    return f"{seconds * 1e3:.1f} ms" if math.isfinite(seconds) else "–"
