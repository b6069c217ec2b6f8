"""The picture: all that the page shows of a moment, as arrays. Data only."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.records import Phase, PredictionStatus
from collision_monitor.shapes.pose import rotation_matrix
from collision_monitor.view.bodies import DescribedBodies, Floats, Indices
from collision_monitor.view.instanced_forms import PLANE, Form
from collision_monitor.view.labels import Label, labels
from collision_monitor.view.levels import COLORS, Level, object_levels, prediction_levels
from collision_monitor.view.moment import Moment
from collision_monitor.view.pair_list import PairRow, soonest_pairs
from collision_monitor.view.paths import paths, radii, tubes
from collision_monitor.view.ribbons import ribbons

Singles = NDArray[np.float32]
Bytes = NDArray[np.uint8]

ROWS: Final = 8
"""Pairs of the list."""

IMPACTS: Final = 24
"""Soonest predicted pairs that are drawn with their paths, and in their poses of impact. More would hide the scene."""

FAR: Final = 1e3
"""m: a scene farther away than this is drawn about an origin of its own, because a browser computes in single
precision, where 1 km has a resolution of 0.06 mm."""


class Role(Enum):
    """What a batch shows: objects that move, those that do not, and objects in their poses of impact."""

    MOVING = "moving"
    STATIC = "static"
    IMPACT = "impact"


class InstanceBatch(NamedTuple):
    """Copies of one form: position (n, 3) m, wxyz (n, 4), scale (n, 3) m, color (n, 3); ids (n,) of their objects."""

    form: Form
    position: Singles
    wxyz: Singles
    scale: Singles
    color: Bytes
    ids: NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class Picture:
    """Lengths in m, positions from `origin` (3,).

    batches: by role and form. clouds: points (n, 3) of scans and maps, with their colours (n, 3) and diameter.
    contacts (c, 3): points; normals (c, 2, 3): lines, from A to B. impacts (i, 3): places of predicted collisions, with
    colours (i, 3). paths (p, 2, 3): line segments, with colours (p, 2, 3). tubes, ribbons of plans: vertices (v, 3) and
    faces (f, 3).
    rows: the list. is_known: whether there are answers. extent: radius of the scene. unit: size of a typical object.
    """

    origin: Floats
    batches: dict[tuple[Role, str], InstanceBatch]
    clouds: Singles
    cloud_colors: Bytes
    cloud_diameter: float
    contacts: Singles
    normals: Singles
    impacts: Singles
    impact_colors: Bytes
    paths: Singles
    path_colors: Bytes
    tubes: tuple[Singles, NDArray[np.uint32]]
    ribbons: tuple[Singles, NDArray[np.uint32]]
    labels: list[Label]
    rows: list[PairRow]
    is_known: bool
    centre: Floats
    extent: float
    unit: float


def draw(moment: Moment, *, origin: Floats | None = None, selected: int | None = None, alerts: bool = False) -> Picture:
    """Return the picture of a moment.

    origin (3,): m, in the world; None: chosen. selected: id of an object to label with its name. alerts: colour by
    alerts instead of answers.
    """
    bodies = moment.bodies
    position, quaternion = moment.state["position"], moment.state["quaternion"]
    centre, extent = _bounds(moment)
    if origin is None:
        origin = np.round(centre) if np.abs(centre).max() > FAR else np.zeros(3)
    raised = (moment.alerts or {}) if alerts else None
    levels = object_levels(
        moment.ids, bodies.static[moment.body], moment.is_known, moment.contacts, moment.predictions, raised
    )
    batches = _batches(moment, position - origin, quaternion, levels, extent)
    shown = moment.predictions[:IMPACTS]
    batches |= _impact_batches(moment, shown, origin)
    contacts = moment.contacts[moment.contacts["phase"] != Phase.END]
    contacts = contacts[np.isfinite(contacts["point_a"]).all(axis=1) & np.isfinite(contacts["normal"]).all(axis=1)]
    unit = _unit(moment)
    point = contacts["point_a"] - origin
    placed = shown[np.isfinite(shown["point"]).all(axis=1)]
    line, line_colors, tube = _paths(moment, shown, origin)
    rows = soonest_pairs(moment, ROWS)
    clouds, cloud_colors, cloud_diameter = _clouds(batches)
    return Picture(
        origin=origin,
        batches={key: batch for key, batch in batches.items() if len(batch.form.faces)},
        clouds=clouds,
        cloud_colors=cloud_colors,
        cloud_diameter=max(cloud_diameter, 0.004 * extent),
        contacts=point.astype(np.float32),
        normals=np.stack([point, point + unit * contacts["normal"]], axis=1).astype(np.float32),
        impacts=(placed["point"] - origin).astype(np.float32),
        impact_colors=COLORS[prediction_levels(placed)],
        paths=line,
        path_colors=line_colors,
        tubes=tube,
        ribbons=ribbons(moment, origin),
        labels=labels(moment, rows, selected, origin, extent, unit),
        rows=rows,
        is_known=moment.is_known,
        centre=centre - origin,
        extent=extent,
        unit=unit,
    )


def _bounds(moment: Moment) -> tuple[Floats, float]:
    """Return the centre (3,) and the radius of what there is, without half-spaces (m)."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for name, pieces in moment.bodies.pieces.items():
        piece, which = pieces.of(moment.body)
        if name != PLANE and len(piece):
            state, (centre, half) = moment.state[which], pieces.form.bounds
            at, turned = pieces.placed(piece, state["position"], state["quaternion"])
            rotation, scale = rotation_matrix(turned), pieces.scale[piece]
            at = at + np.einsum("nij,nj->ni", rotation, centre * scale)
            reach = np.einsum("nij,nj->ni", np.abs(rotation), half * scale)
            low, high = np.minimum(low, (at - reach).min(axis=0)), np.maximum(high, (at + reach).max(axis=0))
    if not np.isfinite(low).all():
        return np.zeros(3), 10.0
    return 0.5 * (low + high), max(0.5 * float(np.linalg.norm(high - low)), 1e-3)


def _unit(moment: Moment) -> float:
    moving = moment.body[~moment.bodies.static[moment.body]]
    reach = moment.bodies.reach[moving if len(moving) else moment.body]
    reach = reach[reach > 0.0]
    return float(np.median(reach)) if len(reach) else 1.0


def _batches(
    moment: Moment, position: Floats, quaternion: Floats, levels: Bytes, extent: float
) -> dict[tuple[Role, str], InstanceBatch]:
    static = moment.bodies.static[moment.body]
    found: dict[tuple[Role, str], InstanceBatch] = {}
    for role, rows in ((Role.MOVING, np.flatnonzero(~static)), (Role.STATIC, np.flatnonzero(static))):
        placed = _placed(moment, rows, position[rows], quaternion[rows], COLORS[levels[rows]], extent)
        found |= {(role, name): batch for name, batch in placed.items()}
    return found


def _placed(
    moment: Moment, rows: Indices, position: Floats, quaternion: Floats, color: Bytes, extent: float = 1.0
) -> dict[str, InstanceBatch]:
    """Return the batches of objects (k,) at these poses, by form."""
    found = {}
    bodies: DescribedBodies = moment.bodies
    for name, pieces in bodies.pieces.items():
        piece, which = pieces.of(moment.body[rows])
        if len(piece):
            at, turned = pieces.placed(piece, position[which], quaternion[which])
            scale = pieces.scale[piece] * (2.5 * extent if name == PLANE else 1.0)
            wxyz = turned[:, [3, 0, 1, 2]]
            ids = moment.ids[rows[which]]
            placed: list[Singles] = [each.astype(np.float32) for each in (at, wxyz, scale)]
            found[name] = InstanceBatch(pieces.form, placed[0], placed[1], placed[2], color[which], ids)
    return found


def _clouds(batches: dict[tuple[Role, str], InstanceBatch]) -> tuple[Singles, Bytes, float]:
    """Return the points (n, 3) of all clouds at their poses, their colours (n, 3) and their largest diameter (m).

    They are drawn together, because a scan has other points each time. Clouds in poses of impact are left out.
    """
    points, colors, diameter = [np.zeros((0, 3))], [np.zeros((0, 3), np.uint8)], 0.0
    for (role, _), batch in batches.items():
        if len(batch.form.faces) or role is Role.IMPACT:
            continue
        diameter = max(diameter, batch.form.diameter)
        for k, turn in enumerate(rotation_matrix(batch.wxyz[:, [1, 2, 3, 0]].astype(np.float64))):
            points.append(batch.form.vertices @ turn.T + batch.position[k])
            colors.append(np.tile(batch.color[k], (len(batch.form.vertices), 1)))
    return np.concatenate(points).astype(np.float32), np.concatenate(colors), diameter


def _impact_batches(moment: Moment, shown: NDArray[np.void], origin: Floats) -> dict[tuple[Role, str], InstanceBatch]:
    """Return both objects of each certain collision at the time of impact. Only those have a pose of impact."""
    certain = shown[(shown["status"] == PredictionStatus.HIT) & np.isfinite(shown["lower"])]
    rows = moment.rows_of(np.concatenate([certain["id_a"], certain["id_b"]]))
    after = np.tile(certain["lower"], 2)
    known = rows >= 0
    known[known] = ~moment.bodies.static[moment.body[rows[known]]]
    rows, after = rows[known], after[known]
    position, quaternion = moment.poses_at(rows, after)
    color = np.tile(COLORS[Level.PREDICTED], (len(rows), 1))
    placed = _placed(moment, rows, position - origin, quaternion, color)
    return {(Role.IMPACT, name): batch for name, batch in placed.items()}


def _paths(
    moment: Moment, shown: NDArray[np.void], origin: Floats
) -> tuple[Singles, Bytes, tuple[Singles, NDArray[np.uint32]]]:
    """Return segments, their colours, and tubes of the objects of these predictions.

    A path ends at the impact that is predicted first, or else at the horizon.
    """
    until: dict[int, tuple[float, int]] = {}
    for row, level in zip(shown, prediction_levels(shown).tolist(), strict=True):
        end = float(row["lower"] if level == Level.PREDICTED else moment.horizon)
        for object_id in (int(row["id_a"]), int(row["id_b"])):
            until.setdefault(object_id, (end, level))
    rows = moment.rows_of(np.fromiter(until, np.uint32, len(until)))
    ends, levels = np.array(list(until.values()), np.float64).reshape(-1, 2).T
    moving = rows >= 0
    moving[moving] = ~moment.bodies.static[moment.body[rows[moving]]]
    rows, ends, levels = rows[moving], ends[moving], levels[moving].astype(np.intp)
    path = paths(moment, rows, ends) - origin
    segments = np.stack([path[:, :-1], path[:, 1:]], axis=2)
    count = segments.shape[1]
    radius = radii(moment, rows, ends)
    wide = radius.max(axis=1, initial=0.0) > 0.0
    return (
        segments.reshape(-1, 2, 3).astype(np.float32),
        np.repeat(np.repeat(COLORS[levels], count, axis=0)[:, None], 2, axis=1),
        tubes(path[wide], radius[wide]),
    )
