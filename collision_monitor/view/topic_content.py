"""The scene of a monitor, message by message: its objects, their last states and the last answers."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor import records
from collision_monitor.codec import (
    CollisionAlert,
    ContactArray,
    MonitorStatus,
    ObjectDescriptionArray,
    ObjectStateArray,
    PredictedCollisionArray,
    Removal,
    decode_alert,
    decode_alerts,
    decode_contacts,
    decode_descriptions,
    decode_parameter_event,
    decode_predictions,
    decode_states,
    decode_status,
    decode_trajectories,
)
from collision_monitor.codec.alerts import AlertLevel
from collision_monitor.codec.states import COVARIANCE_SIZE
from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.pipeline.catalogue import Catalogue
from collision_monitor.pipeline.followed_plans import FollowedPlans
from collision_monitor.pipeline.settings_event import RULES
from collision_monitor.records import StateFlag
from collision_monitor.shapes.pose import shortest_turns
from collision_monitor.tolerances import LARGEST_INPUT, UNIT_QUATERNION
from collision_monitor.uncertainty.spread import worst_stddevs
from collision_monitor.view.bodies import DescribedBodies, described_pieces
from collision_monitor.view.instanced_forms import Piece
from collision_monitor.view.levels import Level, Pair
from collision_monitor.view.moment import Moment

States = NDArray[np.void]

_ALERTS_LAST: Final = 1_500_000_000
"""ns for which the raised alerts of a live monitor hold without being repeated."""

_NEVER: Final = np.iinfo(np.int64).min


class TopicContent:
    """The newest content of a monitor's topics, live or from a session.

    frame_id: states and descriptions in another frame are ignored, as the monitor refuses them; empty: not known yet,
    the answers tell it. has_rules: whether the monitor of a session begins with rules for alerts.
    """

    def __init__(self, frame_id: str = "", *, has_rules: bool = False) -> None:
        self.frame_id = frame_id
        self._has_rules = has_rules
        self._raised: dict[tuple[str, Pair], Level] = {}
        self._raised_ns = 0
        self.status: MonitorStatus | None = None
        self._catalogue = Catalogue()
        self._is_shared = False
        self._pieces: dict[int, list[Piece]] = {}
        self._bodies = DescribedBodies()
        self._removed: set[int] = set()
        self._is_changed = False
        self._state = np.zeros(0, records.STATE)
        self._stamp = np.zeros(0, np.int64)
        self._newest = 0
        self._contacts: ContactArray | None = None
        self._predictions: PredictedCollisionArray | None = None
        self._plans = FollowedPlans()

    def take(self, kind: str, data: bytes) -> None:
        """Take a message. kind: its type, such as `ContactArray`; others are ignored. Raises MessageError."""
        match kind:
            case "ObjectDescriptionArray":
                self._describe(decode_descriptions(data))
            case "ObjectStateArray":
                self._move(decode_states(data))
            case "ObjectTrajectoryArray":
                plans = decode_trajectories(data)
                if self._is_ours(plans.frame_id):
                    self._plans.take(plans)
            case "ContactArray":
                contacts = decode_contacts(data)
                if self._contacts is not None and contacts.stamp_ns < self._contacts.stamp_ns:
                    self._set_back(contacts.stamp_ns)
                self._contacts, self.frame_id = contacts, contacts.frame_id
            case "PredictedCollisionArray":
                self._predictions = decode_predictions(data)
                self.frame_id = self._predictions.frame_id
            case "CollisionAlert":
                self._raise(decode_alert(data))
            case "CollisionAlertArray":
                array = decode_alerts(data)
                self._raised, self._raised_ns = {}, array.stamp_ns
                for alert in array.alerts:
                    self._raise(alert)
            case "ParameterEvent":
                self._has_rules = bool(decode_parameter_event(data).changed.get(RULES, self._has_rules))
            case "MonitorStatus":
                self.status = decode_status(data)

    def copy(self) -> TopicContent:
        """Return a scene that takes further messages without changing this one."""
        self._is_shared = True
        other = copy.copy(self)
        other._state, other._stamp = self._state.copy(), self._stamp.copy()
        other._removed, other._raised = set(self._removed), dict(self._raised)
        other._plans = self._plans.copy()
        return other

    def moment(self) -> Moment:
        """Return the moment after the last messages."""
        self._adopt()
        bodies, contacts, predictions = self._bodies, self._contacts, self._predictions
        answers = [each for each in (contacts, predictions) if each is not None]
        last: Any = max(answers, key=lambda each: each.step, default=None)
        stamp = self._newest if last is None else last.stamp_ns
        body = np.flatnonzero(self._stamp != _NEVER)
        state = self._state[body]
        age = np.where(bodies.static[body], 0.0, (stamp - self._stamp[body]) * NANOSECOND)
        names = {
            object_id: name for each in answers for object_id, name in zip(each.ids.tolist(), each.names, strict=False)
        }
        moment = Moment(
            bodies,
            body,
            state,
            age,
            names=names,
            stamp_ns=stamp,
            step=0 if last is None else last.step,
            is_known=contacts is not None and predictions is not None,
            alerts=self._alerts(stamp),
            plans={id_: each for id_, each in self._plans.plans.items() if each.ends_ns >= stamp},
            left_plans=frozenset(self._plans.left),
        )
        if contacts is not None:
            moment = replace(moment, contacts=contacts.contacts)
        if predictions is not None:
            moment = replace(moment, predictions=predictions.predictions, horizon=predictions.horizon)
        return moment

    # -- alerts

    def _raise(self, alert: CollisionAlert) -> None:
        key = alert.rule, (alert.id_a, alert.id_b)
        self._raised.pop(key, None)
        if alert.level:
            self._raised[key] = Level[AlertLevel(alert.level).name]

    def _alerts(self, stamp_ns: int) -> dict[Pair, Level] | None:
        """Return the highest raised level of each pair; None without rules.

        A live monitor with rules repeats what is raised twice a second, and one without rules does not.
        """
        if not self._has_rules and not (self._raised_ns and abs(stamp_ns - self._raised_ns) <= _ALERTS_LAST):
            return None
        pairs: dict[Pair, Level] = {}
        for (_, pair), level in self._raised.items():
            pairs[pair] = max(level, pairs.get(pair, level))
        return pairs

    # -- objects

    def _describe(self, message: ObjectDescriptionArray) -> None:
        if not self._is_ours(message.frame_id):
            return
        if self._is_shared:
            self._catalogue, self._is_shared = _copied(self._catalogue), False
            self._pieces = dict(self._pieces)
        for change in self._catalogue.changes(message):
            self._catalogue.apply(change)
            if isinstance(change, Removal):
                self._removed.add(change.object_id)
                self._plans.forget([change.object_id])
                self._pieces.pop(change.object_id, None)
            else:
                self._pieces[change.object_id] = described_pieces(change)
        self._is_changed = True

    def _adopt(self) -> None:
        """Take over the described objects. Those that were known and not removed keep their states."""
        if not self._is_changed:
            return
        before, state, stamp = self._bodies, self._state, self._stamp
        self._bodies = bodies = DescribedBodies(tuple(self._catalogue.descriptions.values()), self._pieces)
        self._state, self._stamp = np.zeros(len(bodies.ids), records.STATE), np.full(len(bodies.ids), _NEVER)
        kept = ~np.isin(before.ids, list(self._removed)) & np.isin(before.ids, bodies.ids) & ~before.static
        at = np.searchsorted(bodies.ids, before.ids[kept])
        self._state[at], self._stamp[at] = state[kept], stamp[kept]
        for k in np.flatnonzero(bodies.static):
            pose = bodies.descriptions[k].pose
            assert pose is not None
            self._state[k] = np.zeros((), records.STATE)
            self._state["position"][k], self._state["quaternion"][k] = pose.position, pose.quaternion
            self._stamp[k] = 0
        self._removed = set()
        self._is_changed = False

    def _is_ours(self, frame_id: str) -> bool:
        return not frame_id or not self.frame_id or frame_id == self.frame_id

    # -- states

    def _move(self, message: ObjectStateArray) -> None:
        """Take over the states that the monitor does not refuse."""
        if not self._is_ours(message.frame_id):
            return
        self._adopt()
        self._newest = max(self._newest, message.stamp_ns)
        ids, states = self._bodies.ids, message.states.copy()
        if not len(ids):
            return
        at = np.minimum(np.searchsorted(ids, states["id"]), len(ids) - 1)
        taken = (ids[at] == states["id"]) & ~self._bodies.static[at] & (self._stamp[at] < message.stamp_ns)
        taken &= _are_usable(states)
        if len(message.covariance) == COVARIANCE_SIZE * len(states):
            _write_worst_stddevs(states, message.covariance.reshape(-1, COVARIANCE_SIZE))
        at, states = at[taken], states.compress(taken)
        before = self._stamp[at]
        elapsed = np.where(before == _NEVER, np.inf, (message.stamp_ns - np.maximum(before, 0)) * NANOSECOND)
        _estimate_twists(states, self._state[at], elapsed)
        self._state[at], self._stamp[at] = states, message.stamp_ns
        self._plans.move(message.stamp_ns, states)

    def _set_back(self, stamp_ns: int) -> None:
        """Follow the monitor, which has accepted an earlier clock: states from that time on are new."""
        moving = ~self._bodies.static & (self._stamp != _NEVER)
        self._stamp[moving] = np.minimum(self._stamp[moving], stamp_ns)
        self._newest = stamp_ns
        self._plans.restart()


def _copied(catalogue: Catalogue) -> Catalogue:
    other = Catalogue.restored(catalogue.facts())
    other.descriptions = dict(catalogue.descriptions)
    return other


def _are_usable(states: States) -> NDArray[np.bool_]:
    """Return which states (n,) the monitor takes for their numbers, as `monitor.intake.take_states`."""
    known = (states["flags"] & StateFlag.TWIST_UNKNOWN) == 0
    accelerates = (states["flags"] & StateFlag.ACCELERATION_VALID) != 0
    usable: NDArray[np.bool_] = (np.abs(states["position"]) <= LARGEST_INPUT).all(axis=1)
    usable &= np.abs(np.linalg.norm(states["quaternion"], axis=1) - 1.0) <= UNIT_QUATERNION
    for field in ("linear", "angular"):
        usable &= ~known | (np.abs(states[field]) <= LARGEST_INPUT).all(axis=1)
    usable &= ~accelerates | (np.abs(states["acceleration"]) <= LARGEST_INPUT).all(axis=1)
    return usable


def _write_worst_stddevs(states: States, covariance: NDArray[np.float64]) -> None:
    """Write the standard deviations along the worst axes of covariances (n, 12), where one is declared."""
    declared = np.isfinite(covariance).all(axis=1) & (covariance != 0.0).any(axis=1)
    stddevs = np.maximum(worst_stddevs(covariance[declared])[1], 0.0)
    states["position_stddev"][declared], states["velocity_stddev"][declared] = stddevs.T


def _estimate_twists(states: States, before: States, elapsed: NDArray[np.float64]) -> None:
    """Write unknown twists from two poses, as the monitor estimates them; 0 without an earlier pose.

    before (n,): the states `elapsed` (n,) s earlier; infinite if there is none.
    """
    unknown = (states["flags"] & StateFlag.TWIST_UNKNOWN) != 0
    if not unknown.any():
        return
    jumped = (states["flags"][unknown] & StateFlag.DISCONTINUITY) != 0
    elapsed = np.where(jumped, np.inf, elapsed[unknown])[:, None]
    moved = np.where(np.isinf(elapsed), 0.0, states["position"][unknown] - before["position"][unknown])
    turn, factor = shortest_turns(before["quaternion"][unknown], states["quaternion"][unknown])
    states["linear"][unknown] = moved / elapsed
    states["angular"][unknown] = turn * factor[:, None] / elapsed
    bent = unknown & ((states["flags"] & StateFlag.BODY_TWIST) != 0)  # the estimates are along the world's axes
    states["flags"][bent] &= ~np.uint32(StateFlag.BODY_TWIST | StateFlag.ACCELERATION_VALID)
