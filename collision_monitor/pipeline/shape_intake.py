"""The path of object descriptions from message bytes into the monitor, in the time that a message has.

An object whose model takes long is described by its bounding box first, and again when its model is ready
(`preparation`). A session holds each message as it was taken.
"""

from __future__ import annotations

import dataclasses
from contextlib import suppress
from dataclasses import dataclass

from collision_monitor.codec import Change, Removal, decode_descriptions, encode_descriptions
from collision_monitor.errors import InputError, Refusal, TooCostlyError, reason_of
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.objects.bounding_box_model import bounding_box_model
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.objects.models import Modelled
from collision_monitor.objects.preparation_cost import BOXES_MS, Budget, is_quick
from collision_monitor.pipeline.catalogue import Catalogue
from collision_monitor.pipeline.preparation import STAYS, Job, Preparation
from collision_monitor.pipeline.state_intake import is_in_frame
from collision_monitor.records import Model
from collision_monitor.shapes.registry import Grid

Budgets = tuple[Budget, Budget]
"""Of one message: for the objects with their own models, and for the boxes."""


@dataclass(frozen=True, eq=False)
class TakenShapes:
    """The changes that a message made; and the message as the monitor took it, which a session needs."""

    changes: list[Change]
    data: bytes


class ShapeIntake:
    """Adds, replaces and removes objects in a monitor and in its catalogue.

    frame_id: of the messages. preparation: makes the models that take long; None: they are made at once.
    """

    def __init__(self, monitor: Monitor, catalogue: Catalogue, frame_id: str, preparation: Preparation | None) -> None:
        self._monitor, self._catalogue, self._frame_id = monitor, catalogue, frame_id
        self._preparation = preparation
        self._without_model = 0, ""  # number of refusals then, and the last text about an object without its own model

    def take(self, data: bytes, ready: Modelled | None = None) -> TakenShapes:
        """Process an ObjectDescriptionArray. An impossible object alone is refused.

        ready: what represents the only object of the message, if it is known already.
        """
        try:
            message = decode_descriptions(data)
        except Exception as error:  # see `reason_of`
            self._monitor.refuse(Refusal.MALFORMED, reason_of(error))
            return TakenShapes([], data)
        if not is_in_frame(self._monitor, self._frame_id, message.frame_id, "ObjectDescriptionArray"):
            return TakenShapes([], data)
        for _, text in message.refused:
            self._monitor.refuse(Refusal.SHAPE, text)
        changes = self._catalogue.changes(message)
        implied = len(changes) - len(message.objects)
        budgets, made, coarse = (Budget(), Budget(BOXES_MS)), [], []
        for k, change in enumerate(changes):
            tried, is_made = self._apply(change, message.stamp_ns, budgets, ready)
            if is_made:
                made.append(tried)
            if tried is not change:  # also if it was refused, so that a replay refuses it for the same reason
                coarse.append(message.model_at[k - implied])
        return TakenShapes(made, _with_model(data, coarse, Model.AABB) if coarse else data)

    def _apply(self, change: Change, stamp_ns: int, budgets: Budgets, ready: Modelled | None) -> tuple[Change, bool]:
        """Change the monitor and then the catalogue. Return the change as it was tried, and whether it was made."""
        was_known = False
        try:
            if isinstance(change, Removal):
                self._monitor.remove(change.object_id)
            else:
                was_known = change.object_id in self._monitor
                _share_tiles(change, self._catalogue.descriptions.get(change.object_id))
                own, boxes = budgets
                boxed = self._describe(change, stamp_ns, own, ready)
                if boxed is not None:
                    change = boxed
                    self._describe_box(boxed, boxes)
        except Exception as error:  # see `reason_of`
            if not isinstance(change, Removal):  # removing an unknown object is no error
                self._monitor.refuse(Refusal.SHAPE, _about(change.object_id, reason_of(error)))
                if not was_known:  # an unexpected error may have left it in the monitor, but not in the catalogue
                    with suppress(InputError):
                        self._monitor.remove(change.object_id)
            return change, False
        self._catalogue.apply(change)
        return change, True

    def _describe(
        self, change: ObjectDescription, stamp_ns: int, own: Budget, ready: Modelled | None
    ) -> ObjectDescription | None:
        """Describe an object in the time that is left. Return what is to be described by its box instead, or None.

        own: for the live monitor alone.
        """
        if is_quick(change.shapes):
            self._monitor.describe(change, ready)
            return None
        model = self._monitor.model_of(change)
        if model is not Model.AABB:
            if ready is None and self._preparation is not None:
                if own.fits(change.shapes, model) and self._described_within(own, change):
                    return None
                ready = self._preparation.result(change, model)
            if ready is not None or self._preparation is None:
                self._monitor.describe(change, ready)
                return None
            coarse = dataclasses.replace(change, model=Model.AABB)
            self._preparation.start(self._job(change, coarse, stamp_ns, model))
            return coarse
        return change

    def _describe_box(self, change: ObjectDescription, boxes: Budget) -> None:
        """Describe an object by its box. `boxes` is used in the same way live and in a replay of what was taken."""
        if not (boxes.fits(change.shapes, Model.AABB) and self._described_within(boxes, change)):
            self._monitor.describe(change, bounding_box_model(change.shapes))

    def _described_within(self, budget: Budget, change: ObjectDescription) -> bool:
        """Describe an object; return False if that needs more exact arithmetic than the budget allows."""
        try:
            with budget.exact():
                self._monitor.describe(change)  # the model is made before anything changes
        except TooCostlyError:
            return False
        return True

    def _job(self, change: ObjectDescription, coarse: ObjectDescription, stamp_ns: int, model: Model) -> Job:
        """The job to make an object's own model: from its shapes as they will be decoded again, to the last bit."""
        data = encode_descriptions(stamp_ns, self._frame_id, [change])
        (again,) = decode_descriptions(data).objects
        assert isinstance(again, ObjectDescription)
        return Job(data, again, coarse, model)

    def take_prepared(self) -> tuple[list[TakenShapes], list[str]]:
        """Describe the objects again whose models are ready. Return what was taken, and texts about the others."""
        taken, texts = [], []
        for each in self._preparation.ended() if self._preparation is not None else ():
            job, result = each.job, each.result
            if self._catalogue.descriptions.get(job.object_id) is not job.coarse:
                continue  # it was removed or described again
            if isinstance(result, str):
                texts.append(f"{_about(job.object_id, result)}; it {STAYS}")
                self._without_model = self._refusals, texts[-1]
            else:
                same = self._monitor.model_of(job.description) is job.model
                taken.append(self.take(job.data, result if same else None))
        return taken, texts

    @property
    def last_refusal(self) -> str:
        """Text about the last object that was refused, or that did not get its own model."""
        refusals, text = self._without_model
        return text if text and refusals == self._refusals else self._monitor.last_refusal

    @property
    def _refusals(self) -> int:
        return sum(self._monitor.refused.values())


def _share_tiles(new: ObjectDescription, known: ObjectDescription | None) -> None:
    """Let the grids of an object that is described again take over the tiles that did not change."""
    for (shape, _), (old, _) in zip(new.shapes, known.shapes if known is not None else (), strict=False):
        if isinstance(shape, Grid) and isinstance(old, Grid):
            shape.share_tiles(old)


def _about(object_id: int, text: str) -> str:
    """The text, with the object in front unless it names it already."""
    what = f"object {object_id}"
    return text if text.startswith(what) else f"{what}: {text}"


def _with_model(data: bytes, offsets: list[int], model: Model) -> bytes:
    """Return a message with this model in the bytes at the offsets."""
    changed = bytearray(data)
    for at in offsets:
        changed[at] = model
    return bytes(changed)
