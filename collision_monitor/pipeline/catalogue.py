"""The catalogue: the one place that holds the descriptions of the monitored objects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec import Change, ObjectDescriptionArray, Removal
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.shapes.planar import is_planar


class Catalogue:
    """The objects that the monitor accepted.

    descriptions: the last one of each object, by id. After a restart from a snapshot they are missing until an object
    is described again. static: ids of the objects that do not move. planar: whether the scene lies in the x-y plane.
    """

    def __init__(self) -> None:
        self.descriptions: dict[int, ObjectDescription] = {}
        self.static: set[int] = set()
        self.planar = False
        self._names: dict[int, str] = {}  # of the removed objects too
        self._removed: set[int] = set()  # since the last step: the next step ends their contacts and needs their names
        self._new: set[int] = set()  # since the last step: they have no contacts that could end

    def changes(self, message: ObjectDescriptionArray) -> list[Change]:
        """Return the changes that a message requests, in order.

        A snapshot first removes each object that it does not mention. An object that the message mentions and the codec
        refused keeps its last description. A snapshot that turns a scene in the plane into one in space, or back,
        first removes all objects, because no object of the one kind is accepted beside one of the other.
        """
        if not message.snapshot:
            return list(message.objects)
        mentioned = {each.object_id for each in message.objects} | {object_id for object_id, _ in message.refused}
        described = [each for each in message.objects if isinstance(each, ObjectDescription)]
        if described and all(_is_planar(each) != self.planar for each in described):
            mentioned = set()
        missing = sorted(self._names.keys() - self._removed - mentioned)
        return [*map(Removal, missing), *message.objects]

    def apply(self, change: Change) -> None:
        """Apply a change that the monitor accepted."""
        object_id = change.object_id
        if isinstance(change, Removal):
            self.descriptions.pop(object_id, None)
            self.static.discard(object_id)
            if object_id in self._new:  # else names would pile up while objects come and go and no step is taken
                self._new.remove(object_id)
                del self._names[object_id]
            else:
                self._removed.add(object_id)
            return
        if object_id not in self._names:
            self._new.add(object_id)
        self.planar = _is_planar(change)
        self.descriptions[object_id] = change
        (self.static.add if change.static else self.static.discard)(object_id)
        self._names[object_id] = change.name
        self._removed.discard(object_id)

    def names(self, ids: NDArray[np.uint32]) -> list[str]:
        """Return the names of these objects. Those that the last step knew have one until the next step has ended."""
        return list(map(self._names.__getitem__, ids.tolist()))

    def name(self, object_id: int) -> str:
        """Return the name of an object, as `names` does."""
        return self._names[object_id]

    def end_step(self) -> None:
        """Forget the names of the removed objects, because the step has ended their contacts."""
        self._new.clear()
        while self._removed:
            del self._names[self._removed.pop()]

    def facts(self) -> dict[str, Any]:
        """Return the state without the descriptions, for a snapshot."""
        return {
            "static": sorted(self.static),
            "planar": self.planar,
            "names": {str(object_id): name for object_id, name in self._names.items()},
            "removed": sorted(self._removed),
            "new": sorted(self._new),
        }

    @classmethod
    def restored(cls, facts: Mapping[str, Any]) -> Catalogue:
        """Restore a catalogue from `facts`. Raises KeyError, TypeError, ValueError or AttributeError for others."""
        catalogue = cls()
        catalogue.static, catalogue._removed = set(facts["static"]), set(facts["removed"])
        catalogue._new = set(facts.get("new", ()))  # older sessions have none
        catalogue.planar = facts.get("planar", False)  # sessions of earlier versions lack it
        catalogue._names = {int(object_id): name for object_id, name in facts["names"].items()}
        return catalogue


def _is_planar(description: ObjectDescription) -> bool:
    return any(is_planar(shape) for shape, _ in description.shapes)
