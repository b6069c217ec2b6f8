"""What the panel says in words: the state of the monitor and the selected object, as HTML."""

from __future__ import annotations

from html import escape
from typing import Final

import numpy as np

from collision_monitor.codec import MonitorStatus
from collision_monitor.records import Phase, PredictionStatus
from collision_monitor.view.moment import Moment

NAMED: Final = 5
"""Objects off their plans that the state names; it counts the others."""


def state_html(title: str, moment: Moment, notes: list[str]) -> str:
    """Return the state: title, counts of a moment, and notes that warn."""
    contacts, predictions = moment.contacts, moment.predictions
    if not moment.is_known:
        notes = [*notes, "touching and predicted pairs are not known"]
    touching = int(np.count_nonzero((contacts["phase"] != Phase.END) & (contacts["point_index"] == 0)))
    objects = f"{len(moment.ids)} object{'' if len(moment.ids) == 1 else 's'}"
    counts = [objects, f"{touching} touching", f"{len(predictions)} predicted"]
    unresolved = int(np.count_nonzero(predictions["status"] == PredictionStatus.UNRESOLVED))
    if unresolved:
        counts.append(f"{unresolved} unresolved")
    if moment.unseen:
        counts.append(f"{moment.unseen} without a pose")
    if moment.left_plans:
        names = ", ".join(map(moment.name_of, sorted(moment.left_plans)[:NAMED]))
        more = len(moment.left_plans) - NAMED
        notes = [*notes, f"off their plans: {names}{f' and {more} more' if more > 0 else ''}"]
    if moment.bodies.boxed:
        notes = [*notes, f"{moment.bodies.boxed} shapes are drawn as their bounding boxes"]
    warned = "".join(f'<div style="color:#ff8a7a">{escape(note)}</div>' for note in notes)
    return (
        f'<div style="font-size:.85em;padding:.2em .9em .4em;font-variant-numeric:tabular-nums">'
        f"<b>{escape(title)}</b><div>{escape(' · '.join(counts))}</div>{warned}</div>"
    )


def object_html(moment: Moment, object_id: int) -> str:
    """Return the facts about one object."""
    row = int(moment.rows_of(np.array([object_id], np.uint32))[0])
    lines = [f"<b>{escape(moment.name_of(object_id))}</b> (id {object_id})"]
    if row < 0:
        lines.append("not there at this time")
    else:
        state, body = moment.state[row], moment.bodies.descriptions[moment.body[row]]
        shapes = [type(shape).__name__ for shape, _ in body.shapes]
        lines.append(escape(", ".join(shapes[:4]) + (f" and {len(shapes) - 4} more" if len(shapes) > 4 else "")))
        lines.append("at " + ", ".join(f"{value:.3f}" for value in state["position"]) + " m")
        if body.static:
            lines.append("does not move")
        else:
            lines.append(f"{np.linalg.norm(state['linear']):.2f} m/s, {np.linalg.norm(state['angular']):.2f} rad/s")
            lines.append(f"last state {moment.age[row]:.2f} s old")
            if object_id in moment.plans:
                plan = moment.plans[object_id]
                left = float(plan.path.times[-1]) - plan.seconds(moment.stamp_ns)
                lines.append(f"follows its plan, which ends in {max(left, 0.0):.1f} s")
            elif object_id in moment.left_plans:
                lines.append("has left its plan")
        if body.padding:
            lines.append(f"padding {body.padding:g} m, which is not drawn")
    return (
        f'<div style="font-size:.85em;padding:0 .9em .3em;font-variant-numeric:tabular-nums">{"<br>".join(lines)}</div>'
    )


def status_notes(status: MonitorStatus | None) -> list[str]:
    """Return what a person should know of a live status."""
    if status is None:
        return ["no status from the monitor yet"]
    notes = []
    if status.objects_stale:
        notes.append(f"{status.objects_stale} objects are stale")
    if status.deferred:
        notes.append(f"{status.deferred} pairs were deferred in this step: the time budget ran out")
    if status.recording == 2:
        notes.append(f"recording failed: {status.recording_error}")
    return notes
