"""The path from message bytes through the monitor to message bytes, which the node and the replay share."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._version import VERSION
from collision_monitor.alerts.alerts import Alerts
from collision_monitor.alerts.missing_objects import MissingObject
from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import (
    Change,
    CollisionAlertArray,
    MonitorStatus,
    encode_alert,
    encode_alerts,
    encode_contacts,
    encode_descriptions,
    encode_predictions,
    encode_status,
)
from collision_monitor.errors import InputError, MessageError, Refusal
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.pipeline.catalogue import Catalogue
from collision_monitor.pipeline.plan_intake import take_plans
from collision_monitor.pipeline.preparation import Preparation
from collision_monitor.pipeline.provenance import provenance
from collision_monitor.pipeline.settings_event import (
    LIMIT,
    NOW,
    RULES,
    SettingsChange,
    decode_settings,
    encode_settings,
)
from collision_monitor.pipeline.shape_intake import ShapeIntake, TakenShapes
from collision_monitor.pipeline.state_intake import ReceivedStates, StateIntake
from collision_monitor.settings.profile import Profile

Records = NDArray[np.void]
_PIPELINE: Final = "pipeline"
"""Key of the pipeline's entry in `Snapshot.facts`."""

_ALERTS: Final = "alerts"
"""Key of the entry of the alerts in `Snapshot.facts`; without rules there is none."""

_AS_THEY_WERE: Final[Mapping[str, Any]] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class Outputs:
    """Answers of one step: complete CDR messages, and the result that they hold.

    settings: None, or the ParameterEvent with which a replay answers what the clock made of this step: where its budget
    ended, and how old the states were. It has to be recorded before the states. alerts: a CollisionAlert for each alert
    that the step has changed.
    """

    contacts: bytes
    predictions: bytes
    result: StepResult
    digest: int
    settings: bytes | None = None
    alerts: tuple[bytes, ...] = ()


class Pipeline:
    """Feeds a Monitor with message bytes. No method raises for the content of a message: it is refused and counted.

    catalogue: the monitored objects with their last descriptions. timed: whether a profile's budget applies; in a
    replay the recorded settings determine how far each step comes. kept: settings that no recorded change alters.
    preparation: makes the models that take long; None: they are made at once, however long it takes. rules: of
    the alerts; None: there are no alerts.
    """

    def __init__(
        self,
        profile: Profile | str = "balanced",
        frame_id: str = "world",
        *,
        timed: bool = True,
        kept: Collection[str] = (),
        preparation: Preparation | None = None,
        rules: Rules | None = None,
    ) -> None:
        self.monitor = Monitor(profile, timed=timed, warns=False)
        self.catalogue = Catalogue()
        self.frame_id = frame_id
        self._shapes = ShapeIntake(self.monitor, self.catalogue, frame_id, preparation)
        self._states = StateIntake(self.monitor, frame_id)
        self._alerts = Alerts(rules)
        self._kept = frozenset(kept)
        self._limit = self.monitor.profile.pairs_per_step  # the value that a replay has
        self._now: int | None = None  # recorded time (ns) at which the next states were processed

    # -- states: one step

    def on_states(self, data: bytes, now_ns: int | None = None) -> Outputs | None:
        """Process an ObjectStateArray, which is one step. None: the message was refused and there is no new answer.

        now_ns: when the answers will be there, see `Monitor.step`. In a replay the recording holds it.
        """
        return self.take_states(ReceivedStates.decode(data), now_ns)

    def take_states(
        self, states: ReceivedStates, now_ns: int | None = None, publish: Callable[[Outputs], None] | None = None
    ) -> Outputs | None:
        """Process an ObjectStateArray as `on_states` does. publish: gets the answers within the budget of the step."""
        recorded, self._now = self._now, None
        now_ns = recorded if now_ns is None else now_ns
        with self.monitor.clock:
            result = self._states.take(states, now_ns)
            if result is None:
                return None
            outputs = self._encode(result, now_ns)
            if publish is not None:
                publish(outputs)
            return outputs

    def _encode(self, result: StepResult, now_ns: int | None) -> Outputs:
        header = result.stamp_ns, self.frame_id, result.step
        horizon = self.monitor.profile.horizon
        contacts = encode_contacts(*header, result.contact_rows, *self._mentioned(result.contact_rows))
        predictions = encode_predictions(*header, horizon, result.predictions, *self._mentioned(result.predictions))
        alerts = self._alerts.step(self.monitor, result, self.frame_id, self.catalogue.name)
        self.catalogue.end_step()
        settings, digest = self._settings_of(result, now_ns), self.monitor.digest
        return Outputs(contacts, predictions, result, digest, settings, tuple(map(encode_alert, alerts)))

    def _mentioned(self, answers: Records) -> tuple[NDArray[np.uint32], list[str]]:
        """Return the ids in `answers`, ascending, and their names."""
        ids = np.sort(np.concatenate([answers["id_a"], answers["id_b"]]))  # np.unique hashes, four times as slow
        is_first = np.ones(len(ids), np.bool_)
        np.not_equal(ids[1:], ids[:-1], out=is_first[1:])
        ids = ids[is_first]
        return ids, self.catalogue.names(ids)

    def _settings_of(self, result: StepResult, now_ns: int | None) -> bytes | None:
        """Return what a replay of this step needs to know of the clock; None: nothing."""
        changes: dict[str, Any] = {}
        needed = self.monitor.profile.pairs_per_step if result.cut is None else result.cut
        if needed != self._limit:
            self._limit = changes[LIMIT] = needed
        if result.overtaken:
            changes[NOW] = now_ns
        return encode_settings(result.stamp_ns, "", changes) if changes else None

    # -- shapes

    def on_shapes(self, data: bytes) -> list[Change]:
        """Process an ObjectDescriptionArray: add, replace and remove objects. An impossible object alone is refused.

        Returns the changes that were made, in order, with the removals that a snapshot implies.
        """
        return self.take_shapes(data).changes

    def take_shapes(self, data: bytes) -> TakenShapes:
        """Process an ObjectDescriptionArray as `on_shapes` does. Return what a session has to hold of it."""
        self._alerts.forget_classes()
        return self._shapes.take(data)

    def take_prepared(self) -> tuple[list[TakenShapes], list[str]]:
        """Describe the objects again whose models are ready. Return what was taken, and texts about the others."""
        taken, texts = self._shapes.take_prepared()
        if taken:
            self._alerts.forget_classes()
        return taken, texts

    # -- plans

    def on_trajectories(self, data: bytes) -> None:
        """Process an ObjectTrajectoryArray: objects follow these plans from now on. An impossible one is refused."""
        take_plans(self.monitor, self.frame_id, data)

    # -- settings

    def on_settings(self, data: bytes) -> None:
        """Process a ParameterEvent from `change_settings`: settings that are in force from now on.

        Objects keep their models until they are described again. A session holds those descriptions behind the event.
        """
        try:
            changes = {name: value for name, value in decode_settings(data).items() if name not in self._kept}
            if (text := changes.pop(RULES, None)) is not None:
                self._alerts.use(Rules.parse(str(text)))
            self._now = _time(changes.pop(NOW, None))
            self.monitor.profile = self.monitor.profile.replace(**changes)
            self._limit = changes.get(LIMIT, self._limit)
        except (MessageError, InputError) as error:
            self.monitor.refuse(Refusal.MALFORMED, str(error))

    def change_settings(self, profile: Profile, stamp_ns: int, node: str = "") -> SettingsChange:
        """Use this profile from now on. Describe those objects again that get another model by it."""
        monitor = self.monitor
        changes = monitor.profile.differences(profile)
        objects = list(self.catalogue.descriptions.values())
        models = list(map(monitor.model_of, objects))
        self._limit = changes.get(LIMIT, self._limit)
        monitor.profile = profile
        limited = "model_error" in changes
        remodelled = [
            it
            for it, model in zip(objects, models, strict=True)
            if monitor.model_of(it) is not model or (limited and model is not it.model)
        ]
        shapes = encode_descriptions(stamp_ns, self.frame_id, remodelled) if remodelled else None
        if shapes is not None:
            shapes = self.take_shapes(shapes).data
        return SettingsChange(encode_settings(stamp_ns, node, changes), shapes)

    # -- alerts

    @property
    def rules(self) -> Rules:
        """The rules of the alerts that are in force."""
        return self._alerts.rules

    def change_rules(self, rules: Rules, stamp_ns: int, node: str = "") -> bytes:
        """Use these rules from the next step on. Return the ParameterEvent that a session needs."""
        self._alerts.use(rules)
        return encode_settings(stamp_ns, node, {RULES: rules.text})

    def raised_alerts(self, missing: Iterable[MissingObject] = (), number: int = 0) -> bytes:
        """Return the bytes of `raised_alert_array`."""
        return encode_alerts(self.raised_alert_array(missing, number))

    def raised_alert_array(self, missing: Iterable[MissingObject] = (), number: int = 0) -> CollisionAlertArray:
        """Return all alerts that are raised, with the measures of the last step, and what guards need.

        missing: what is asked for and not monitored. number: of the monitor.
        """
        last = self.monitor.last
        stamp_ns, step = (last.stamp_ns, last.step) if last is not None else (0, 0)
        raised = self._alerts.raised(stamp_ns, self.frame_id, step)
        return self._alerts.for_guards(raised, self.monitor, missing, number)

    @property
    def empty_classes(self) -> list[str]:
        """The classes of the rules that no object belongs to."""
        return self._alerts.empty_classes(self.monitor.roster)

    # -- what the monitor says of its inputs

    @property
    def profile(self) -> Profile:
        """The settings in force."""
        return self.monitor.profile

    @property
    def refused(self) -> Mapping[Refusal, int]:
        """Number of refused inputs by reason."""
        return self.monitor.refused

    @property
    def refusal_texts(self) -> Mapping[Refusal, str]:
        """Text of the last refusal by reason, see `Monitor.refusal_texts`."""
        return self.monitor.refusal_texts

    @property
    def restarts(self) -> int:
        """Number of times that the timeline restarted because time jumped."""
        return self.monitor.restarts

    @property
    def has_begun(self) -> bool:
        """Whether there was a step."""
        return self.monitor.last is not None

    def stale(self) -> dict[int, str]:
        """Return the names of the objects that are stale at the latest time, by id."""
        return {object_id: self.monitor.name(object_id) for object_id in self.monitor.stale_ids}

    def unseen(self) -> dict[int, str]:
        """Return the names of the moving objects without any state, by id."""
        return {object_id: self.monitor.name(object_id) for object_id in self.monitor.unseen_ids}

    # -- status and metadata

    def status(self, *, silent: bool = False, **live: Any) -> bytes:
        """Return a MonitorStatus: the last step's counters, and the caller's fields of `codec.status.LIVE_FIELDS`.

        silent: no states arrive any more, so every moving object that was seen counts as stale.
        """
        monitor, last = self.monitor, self.monitor.last
        if last is not None:
            values = dataclasses.asdict(last.status)
            values.update(stamp_ns=last.stamp_ns, step=last.step)
        else:
            objects, static = len(monitor.ids), len(self.catalogue.static)
            values = {"objects": objects, "objects_static": static, "objects_unseen": objects - static}
        if silent:
            values["objects_stale"] = values["objects"] - values["objects_static"] - values["objects_unseen"]
        values.update({f"refused_{reason.value}": monitor.refused.get(reason, 0) for reason in Refusal})
        return encode_status(
            MonitorStatus(
                frame_id=self.frame_id,
                digest=monitor.digest,
                version=VERSION,
                profile=monitor.profile.name,
                last_refusal=self._shapes.last_refusal,
                messages_lost=self._states.lost,
                **values,
                **live,
            )
        )

    def metadata(self, node: str = "") -> dict[str, str]:
        """Return what a replay and its comparison need: profile, frame, versions, determinism key."""
        return {**provenance(), **self.settings(), "frame_id": self.frame_id, "node": node}

    def settings(self) -> dict[str, str]:
        """Return what a session's metadata holds of the settings in force: the profile as JSON; the rules, if any."""
        profile = json.dumps(self.monitor.profile.to_dict(), sort_keys=True)
        return {"profile": profile, **({RULES: self.rules.text} if self._alerts.are_used else {})}

    # -- snapshots

    def snapshot(self) -> Snapshot:
        """Return a copy of all state that later answers depend on. Takes 0.3 ms for 200 objects."""
        snapshot = self.monitor.snapshot()
        snapshot.facts[_PIPELINE] = {
            **self._states.facts(),
            **self.catalogue.facts(),
            "profile": {**self.monitor.profile.to_dict(), LIMIT: self._limit},
        }
        if self._alerts.are_used:
            snapshot.facts[_ALERTS] = self._alerts.save(snapshot)
        return snapshot

    @classmethod
    def restored(cls, snapshot: Snapshot, frame_id: str, settings: Mapping[str, Any] = _AS_THEY_WERE) -> Pipeline:
        """Return a pipeline that continues from the snapshot with the same answers, without a clock.

        Its catalogue has no descriptions at first. settings: replace those in force, permanently. Raises InputError if
        the snapshot cannot be used.
        """
        try:
            facts = snapshot.facts[_PIPELINE]
            profile = Profile.from_dict({**facts["profile"], **settings})
            pipeline = cls(profile, frame_id, timed=False, kept=settings)
            pipeline.monitor = Monitor.restored(profile, snapshot, warns=False)
            pipeline._states = StateIntake.restored(pipeline.monitor, frame_id, facts)
            pipeline.catalogue = Catalogue.restored(facts)
            pipeline._shapes = ShapeIntake(pipeline.monitor, pipeline.catalogue, frame_id, None)
            if _ALERTS in snapshot.facts:
                pipeline._alerts = Alerts.restored(snapshot, snapshot.facts[_ALERTS])
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise InputError(f"snapshot: expected the state of a monitor of this version, got: {error!r}") from None
        return pipeline


def _time(value: Any) -> int | None:
    """Return a recorded time, or None. Raises InputError."""
    if value is None or type(value) is int:
        return value
    raise InputError(f"parameter {NOW}: expected a time in ns, got {value!r}")
