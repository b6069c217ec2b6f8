"""Tracks: objects that appear in messages of a topic and vanish by themselves."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Iterable
from dataclasses import dataclass
from typing import Any, Final

from collision_monitor.sources.ground.source_scene import SourceScene

REMEMBERED: Final = 10_000
"""Vanished tracks whose ids are kept for their return."""

MOST_TRACKS: Final = 10_000
"""Tracks of one topic at a time."""

LONGEST_KEY: Final = 256
"""Characters of a text by which a track is known, such as the id of a detection."""


@dataclass(slots=True)
class DescribedTrack:
    """A track that is described. shape: what its last description was made from, None before the first.

    seen_ns: stamp of its last message. lifetime_ns: after which it vanishes without a new message; 0: never.
    """

    object_id: int
    name: str
    seen_ns: int = 0
    lifetime_ns: int = 0
    shape: Any = None


class TrackTable:
    """The tracks of an entry by their keys, such as UUIDs. A track that returns gets its old id and name.

    line: the key in the sources file. forget_after: s without a message after which a track vanishes; infinite: never.
    """

    def __init__(self, line: str, forget_after: float) -> None:
        self._line = line
        self._tracks: dict[Hashable, DescribedTrack] = {}
        self._vanished: OrderedDict[Hashable, DescribedTrack] = OrderedDict()
        self._forget_after = forget_after

    def __contains__(self, key: Hashable) -> bool:
        """Whether the track is there, or its name is kept for its return."""
        return key in self._tracks or key in self._vanished

    def __len__(self) -> int:
        """Return the number of tracks that are there."""
        return len(self._tracks)

    def touch(self, keys: Iterable[Hashable], stamp_ns: int) -> None:
        """Keep the known ones of these tracks for another `forget_after`, although their states cannot be used."""
        for key in keys:
            if (track := self._tracks.get(key)) is not None:
                track.seen_ns = max(track.seen_ns, stamp_ns)

    def known(self, key: Hashable) -> DescribedTrack | None:
        """Return the track with this key, if it is there."""
        return self._tracks.get(key)

    def get(
        self, key: Hashable, name: str, stamp_ns: int, scene: SourceScene, object_id: int | None = None
    ) -> DescribedTrack | None:
        """Return the track with this key, or a new one. None, after a refusal, if there are too many.

        name, object_id: of a new one; None: the next free id.
        """
        track = self._tracks.get(key)
        if track is None:
            if len(self._tracks) >= MOST_TRACKS:
                scene.refuse(self._line, f"expected at most {MOST_TRACKS} objects of one entry")
                return None
            track = self._vanished.pop(key, None) or DescribedTrack(
                scene.new_id() if object_id is None else object_id, name
            )
            track.seen_ns = stamp_ns
            self._tracks[key] = track
        track.seen_ns = max(track.seen_ns, stamp_ns)
        return track

    def drop(self, key: Hashable, scene: SourceScene) -> None:
        """Remove the track with this key, if there is one."""
        track = self._tracks.pop(key, None)
        if track is None:
            return
        scene.remove(track.object_id)
        scene.has(self._line, track.name)  # what is gone is not missing
        track.shape = None
        self._vanished[key] = track
        if len(self._vanished) > REMEMBERED:
            self._vanished.popitem(last=False)

    def expire(self, now_ns: int, scene: SourceScene) -> None:
        """Remove the tracks that have not been seen for `forget_after`, or whose lifetime is over."""
        if not self._tracks:
            return
        oldest = now_ns - self._forget_after * 1e9
        for key in [
            key
            for key, track in self._tracks.items()
            if track.seen_ns < oldest or 0 < track.lifetime_ns < now_ns - track.seen_ns
        ]:
            self.drop(key, scene)

    def restart(self, now_ns: int) -> None:
        """Let all tracks count as seen now: time jumped, or went back."""
        for track in self._tracks.values():
            track.seen_ns = now_ns

    def all_keys(self) -> list[Hashable]:
        """Return the keys of all tracks."""
        return list(self._tracks)
