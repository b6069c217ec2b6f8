"""What the monitored objects are: the one place for what is described."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec import Change, ObjectDescriptionArray, Removal
from collision_monitor.objects.description import ObjectDescription


class Catalogue:
    """The objects that the monitor accepted.

    descriptions: the last one of each object, by id. After a restart from a snapshot they are missing until an object
    is described again. static: the ids of objects that do not move.
    """

    def __init__(self) -> None:
        self.descriptions: dict[int, ObjectDescription] = {}
        self.static: set[int] = set()
        self._names: dict[int, str] = {}  # also of the removed ones
        self._removed: set[int] = set()  # since the last step: their contacts end in the next one and need their names

    def changes(self, message: ObjectDescriptionArray) -> list[Change]:
        """The changes that a message asks for, in order; a snapshot first removes each object that it does not mention.

        An object that the message mentions and the codec refused stays as it was described before.
        """
        if not message.snapshot:
            return list(message.objects)
        mentioned = {each.object_id for each in message.objects} | {object_id for object_id, _ in message.refused}
        missing = sorted(self._names.keys() - self._removed - mentioned)
        return [*map(Removal, missing), *message.objects]

    def apply(self, change: Change) -> None:
        """Take in a change that the monitor accepted."""
        object_id = change.object_id
        if isinstance(change, Removal):
            self.descriptions.pop(object_id, None)
            self.static.discard(object_id)
            self._removed.add(object_id)
            return
        self.descriptions[object_id] = change
        (self.static.add if change.static else self.static.discard)(object_id)
        self._names[object_id] = change.name
        self._removed.discard(object_id)

    def names(self, ids: NDArray[np.uint32]) -> list[str]:
        """The names of these objects; those removed since the last step still have one."""
        return list(map(self._names.__getitem__, ids.tolist()))

    def forget_removed(self) -> None:
        """A step ended the contacts of the removed objects: their names are not needed any more."""
        while self._removed:
            del self._names[self._removed.pop()]

    def facts(self) -> dict[str, Any]:
        """The state but for the descriptions, for a snapshot."""
        return {
            "static": sorted(self.static),
            "names": {str(object_id): name for object_id, name in self._names.items()},
            "removed": sorted(self._removed),
        }

    @classmethod
    def restored(cls, facts: Mapping[str, Any]) -> Catalogue:
        """The inverse of `facts`. Raises KeyError, TypeError, ValueError or AttributeError for other facts."""
        catalogue = cls()
        catalogue.static, catalogue._removed = set(facts["static"]), set(facts["removed"])
        catalogue._names = {int(object_id): name for object_id, name in facts["names"].items()}
        return catalogue
