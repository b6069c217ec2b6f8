"""Message bytes in, the monitor, message bytes out: the one path that the node and the replay share."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._version import VERSION
from collision_monitor.codec import (
    Descriptions,
    Removal,
    Status,
    decode_descriptions,
    decode_parameter_event,
    decode_states,
    encode_contacts,
    encode_descriptions,
    encode_parameter_event,
    encode_predictions,
    encode_status,
)
from collision_monitor.errors import CollisionMonitorError, InputError, MessageError, ProfileError, Refusal
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.monitor.snapshot import Snapshot
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.provenance import provenance
from collision_monitor.settings.profile import Profile

Records = NDArray[np.void]

_PIPELINE: Final = "pipeline"
"""Whose facts these are, in a snapshot."""

_PARAMETER: Final = {"name": "profile"}
_FIELD: Final = {parameter: field for field, parameter in _PARAMETER.items()}
"""How parameters and fields of a profile are called where the two differ."""

_AS_THEY_WERE: Final[Mapping[str, Any]] = MappingProxyType({})

LIMIT: Final = "pairs_per_step"
"""The setting by which a replay does as much as the clock allowed."""

LARGEST_WRAP: Final = 1 << 16
"""A sequence number that falls is the counter's wrap at 2^32 if it lost at most this many messages, else a restart."""


@dataclass(frozen=True, eq=False)
class Outputs:
    """The answers of one step: complete CDR messages, and what they were made of.

    limit: where it is not None, the settings (ParameterEvent) without which a replay would not stop where the clock
    stopped this step, to be recorded before the states.
    """

    contacts: bytes
    predictions: bytes
    result: StepResult
    digest: int
    limit: bytes | None = None


@dataclass(frozen=True)
class SettingsChange:
    """What a session needs where settings change, in this order: complete CDR messages.

    settings: the ParameterEvent. shapes: an ObjectDescriptionArray of the objects that have another model from now on;
    None: there are none.
    """

    settings: bytes
    shapes: bytes | None


class Pipeline:
    """Feeds a Monitor with message bytes. No method raises for what a message holds: it is refused and counted.

    objects: what is monitored, as it was described last, by id. timed: whether a profile's budget counts; in a replay
    the recorded settings say how far each step came. kept: settings that no recorded change alters.
    """

    def __init__(
        self,
        profile: Profile | str = "balanced",
        frame_id: str = "world",
        *,
        timed: bool = True,
        kept: Collection[str] = (),
    ) -> None:
        self.monitor = Monitor(profile, timed=timed)
        self.frame_id = frame_id
        self.messages_lost = 0
        self._kept = frozenset(kept)
        self._limit = self.monitor.profile.pairs_per_step  # as a replay knows it
        self.objects: dict[int, ObjectDescription] = {}
        self._sequence: int | None = None
        self._static: set[int] = set()
        self._names: dict[int, str] = {}  # also of what was removed since the last step, whose contacts end in the next
        self._removed: set[int] = set()

    # -- in

    def on_shapes(self, data: bytes) -> Descriptions | None:
        """An ObjectDescriptionArray: add, replace, remove. An object that cannot be is refused, the others not.

        Returns the message as it was read; None: it was refused as a whole.
        """
        try:
            message = decode_descriptions(data)
        except MessageError as error:
            self.monitor.refuse(Refusal.MALFORMED, str(error))
            return None
        if not self._is_our_frame(message.frame_id, "ObjectDescriptionArray"):
            return None
        for _, text in message.refused:
            self.monitor.refuse(Refusal.SHAPE, text)
        if message.snapshot:
            # A refused object stays in the set: if it is known, it goes on being monitored as what it was.
            kept = {each.object_id for each in message.objects} | {object_id for object_id, _ in message.refused}
            for object_id in sorted(set(self.monitor.ids) - kept):
                self._remove(object_id)
        for each in message.objects:
            if isinstance(each, Removal):
                self._remove(each.object_id)
            else:
                self._describe(each)
        return message

    def on_states(self, data: bytes) -> Outputs | None:
        """An ObjectStateArray: one step. None: the message was refused as a whole and there is no new answer."""
        with self.monitor.clock:
            return self._step(data)

    def _step(self, data: bytes) -> Outputs | None:
        try:
            message = decode_states(data)
        except MessageError as error:
            self.monitor.refuse(Refusal.MALFORMED, str(error))
            return None
        self._count_lost(message.sequence)
        if not self._is_our_frame(message.frame_id, "ObjectStateArray"):
            return None
        if len(message.covariance) not in (0, 12 * len(message.states)):
            self.monitor.refuse(
                Refusal.MALFORMED,
                f"ObjectStateArray.covariance: expected none or 12 numbers for each of {len(message.states)} states, "
                f"got {len(message.covariance)}",
            )
            return None
        covariance = message.covariance.reshape(-1, 12) if len(message.covariance) else None
        result = self.monitor.step(message.stamp_ns, message.states, covariance=covariance)
        if not result.accepted:
            return None
        return self._outputs(result)

    def on_settings(self, data: bytes) -> None:
        """A ParameterEvent: settings that hold from here on, as `change_settings` gave it.

        Objects keep their models until they are described again, as a session does behind it.
        """
        try:
            changed = decode_parameter_event(data).changed
            changes = {_FIELD.get(name, name): value for name, value in changed.items() if name not in self._kept}
            self.monitor.profile = self.monitor.profile.replace(**changes)
        except (MessageError, ProfileError) as error:
            self.monitor.refuse(Refusal.MALFORMED, str(error))

    def change_settings(self, profile: Profile, stamp_ns: int, node: str = "") -> SettingsChange:
        """Go by this profile from here on; objects whose model it chooses otherwise are described again."""
        monitor = self.monitor
        changes = monitor.profile.differences(profile)
        objects = list(self.objects.values())
        models = list(map(monitor.model_of, objects))
        self._limit = changes.get(LIMIT, self._limit)
        monitor.profile = profile
        named = {_PARAMETER.get(name, name): value for name, value in changes.items()}
        remodelled = [it for it, model in zip(objects, models, strict=True) if monitor.model_of(it) is not model]
        shapes = encode_descriptions(stamp_ns, self.frame_id, remodelled) if remodelled else None
        if shapes is not None:
            self.on_shapes(shapes)
        return SettingsChange(encode_parameter_event(stamp_ns, node, named), shapes)

    # -- out

    def status(self, *, silent: bool = False, **live: Any) -> bytes:
        """A MonitorStatus: the last step's counters, and the fields of `codec.status.LIVE_FIELDS` from the caller.

        silent: states no longer arrive, so every moving object that was seen counts as stale.
        """
        monitor, last = self.monitor, self.monitor.last
        if last is not None:
            values = dataclasses.asdict(last.status)
            values.update(stamp_ns=last.stamp_ns, step=last.step)
        else:
            objects, static = len(monitor.ids), len(self._static)
            values = {"objects": objects, "objects_static": static, "objects_unseen": objects - static}
        if silent:
            values["objects_stale"] = values["objects"] - values["objects_static"] - values["objects_unseen"]
        values.update({f"refused_{reason.value}": monitor.refused.get(reason, 0) for reason in Refusal})
        return encode_status(
            Status(
                frame_id=self.frame_id,
                digest=monitor.digest,
                version=VERSION,
                profile=monitor.profile.name,
                last_refusal=monitor.last_refusal,
                messages_lost=self.messages_lost,
                **values,
                **live,
            )
        )

    def metadata(self, node: str = "") -> dict[str, str]:
        """What a session needs to be replayed and compared: profile, frame, versions, determinism key."""
        return {**provenance(), "profile": self.settings(), "frame_id": self.frame_id, "node": node}

    def settings(self) -> str:
        """The profile in force, as a session's metadata has it."""
        return json.dumps(self.monitor.profile.to_dict(), sort_keys=True)

    # -- snapshots

    def snapshot(self) -> Snapshot:
        """All that later answers depend on, copied: 0.3 ms for 200 objects."""
        snapshot = self.monitor.snapshot()
        snapshot.facts[_PIPELINE] = {
            "messages_lost": self.messages_lost,
            "sequence": self._sequence,
            "static": sorted(self._static),
            "names": {str(object_id): name for object_id, name in self._names.items()},
            "removed": sorted(self._removed),
            "profile": {**self.monitor.profile.to_dict(), LIMIT: self._limit},
        }
        return snapshot

    @classmethod
    def restored(cls, snapshot: Snapshot, frame_id: str, settings: Mapping[str, Any] = _AS_THEY_WERE) -> Pipeline:
        """Goes on from there, without a clock, with the same answers; `objects` holds what is described from now on.

        settings: in place of those that were in force, for good. Raises InputError where the snapshot cannot be used.
        """
        try:
            facts = snapshot.facts[_PIPELINE]
            profile = Profile.from_dict({**facts["profile"], **settings})
            pipeline = cls(profile, frame_id, timed=False, kept=settings)
            pipeline.monitor = Monitor.restored(profile, snapshot)
            pipeline.messages_lost, pipeline._sequence = facts["messages_lost"], facts["sequence"]
            pipeline._static, pipeline._removed = set(facts["static"]), set(facts["removed"])
            pipeline._names = {int(object_id): name for object_id, name in facts["names"].items()}
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"snapshot: expected the state of a monitor of this version, got: {error!r}") from None
        return pipeline

    # -- parts

    def _is_our_frame(self, frame_id: str, message: str) -> bool:
        """An empty frame is taken for ours."""
        if frame_id in ("", self.frame_id):
            return True
        self.monitor.refuse(Refusal.FRAME, f"{message}: expected frame_id {self.frame_id!r}, got {frame_id!r}")
        return False

    def _describe(self, it: ObjectDescription) -> None:
        try:
            self.monitor.describe(it)
        except CollisionMonitorError as error:
            self.monitor.refuse(Refusal.SHAPE, str(error))
            return
        self.objects[it.object_id] = it
        (self._static.add if it.static else self._static.discard)(it.object_id)
        self._names[it.object_id] = it.name
        self._removed.discard(it.object_id)

    def _remove(self, object_id: int) -> None:
        """Removing what is not there is no error: the sender's wish is met."""
        with suppress(InputError):
            self.monitor.remove(object_id)
            self.objects.pop(object_id, None)  # not there where a snapshot was restored
            self._static.discard(object_id)
            self._removed.add(object_id)

    def _count_lost(self, sequence: int) -> None:
        if sequence == 0 and self._sequence != 0xFFFFFFFF:  # of one who does not count
            return
        last, self._sequence = self._sequence, sequence
        if last is None or sequence == last:
            return
        gap = (sequence - last) % (1 << 32) - 1
        if sequence > last or gap <= LARGEST_WRAP:
            self.messages_lost += gap

    def _outputs(self, result: StepResult) -> Outputs:
        outputs = Outputs(
            contacts=encode_contacts(
                result.stamp_ns, self.frame_id, result.step, result.contacts, *self._mentioned(result.contacts)
            ),
            predictions=encode_predictions(
                result.stamp_ns,
                self.frame_id,
                result.step,
                self.monitor.profile.horizon,
                result.predictions,
                *self._mentioned(result.predictions),
            ),
            result=result,
            digest=self.monitor.digest,
            limit=self._limit_of(result),
        )
        while self._removed:
            del self._names[self._removed.pop()]
        return outputs

    def _limit_of(self, result: StepResult) -> bytes | None:
        needed = self.monitor.profile.pairs_per_step if result.cut is None else result.cut
        if needed == self._limit:
            return None
        self._limit = needed
        return encode_parameter_event(result.stamp_ns, "", {LIMIT: needed})

    def _mentioned(self, answers: Records) -> tuple[NDArray[np.uint32], list[str]]:
        """The ids in `answers`, ascending, and their names."""
        ids = np.sort(np.concatenate([answers["id_a"], answers["id_b"]]))  # np.unique hashes, four times as slow
        is_first = np.ones(len(ids), np.bool_)
        np.not_equal(ids[1:], ids[:-1], out=is_first[1:])
        ids = ids[is_first]
        return ids, list(map(self._names.__getitem__, ids.tolist()))
