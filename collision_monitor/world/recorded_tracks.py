"""Playback of recorded tracks of people and carts from CSV files in the format of the CITR data set (arXiv 1902.00487).

`<clip>_ped.csv`: id, frame, label, x_est, y_est, vx_est, vy_est; `<clip>_veh.csv`: id, frame, label, x_est, y_est,
psi_est (heading, rad), vel_est (speed along it); metres, seconds, 29.97 frames/s. The files contain no sizes: a person
is a cylinder of radius 0.25 m and height 1.75 m, a cart a box of 2.4 x 1.2 x 1.8 m, both standing on z = 0.

Velocities are used as recorded. Those of carts are filtered and lag behind the positions by up to 1 m/s when a cart
brakes or accelerates. Predictions inherit this error, as they would from any live tracker.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np

from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.records import StateFlag
from collision_monitor.settings.regular_file import FOLDER, NOTHING, found_instead
from collision_monitor.shapes.pose import from_rotation_vector, multiply
from collision_monitor.shapes.registry import Box, Cylinder, Shape
from collision_monitor.world.scene import TIME_ROUND_OFF, Scene, States, positive_rate, state_array
from collision_monitor.world.track_file import TrackFile, read_track_file

FRAME_RATE = 29.97
"""Frame rate of the recordings (Hz)."""
PAUSE = 30
"""Frames between two consecutive clips."""
PERSON_HEIGHT, CART_HEIGHT = 1.75, 1.8
PERSON = Cylinder(0.25, PERSON_HEIGHT)
CART = Box((2.4, 1.2, CART_HEIGHT))

_PEOPLE, _CARTS = "_ped.csv", "_veh.csv"
_PEOPLE_COLUMNS = ("x_est", "y_est", "vx_est", "vy_est")
_CART_COLUMNS = ("x_est", "y_est", "psi_est", "vel_est")


class RecordedTracks(Scene):
    """Scene "trajectory": all objects are described at the start and have states only while tracked.

    Several clips are played one after another. Ids: people keep theirs, carts get ids above those of the people, and
    each further clip gets ids above all before.
    """

    def __init__(self, objects: int | None, rate: float | None, path: Path | None) -> None:
        if objects is not None:
            raise InputError(f"objects: 'trajectory' plays the recorded objects; omit --objects (got {objects!r})")
        self.name = "trajectory"
        self.rate = positive_rate(rate, FRAME_RATE)
        self.descriptions = []
        clips = _find_clips(path)
        first_frame, rows, frames = 0, [], []
        for clip in clips:
            prefix = f"{_prefix(clip[0]).name}/" if len(clips) > 1 else ""
            tracks = [read_track_file(file, _PEOPLE_COLUMNS if _is_people(file) else _CART_COLUMNS) for file in clip]
            start = min(int(t.frame.min()) for t in tracks)
            for track in tracks:
                rows.append(self._add(track, prefix))
                frames.append(track.frame - start + first_frame)
            first_frame = int(max(f.max() for f in frames)) + PAUSE
        frame, row = np.concatenate(frames), np.concatenate(rows)
        order = np.lexsort((row["id"], frame))
        self._frame, self._row = frame[order], row[order]
        self.duration = float(self._frame[-1]) / FRAME_RATE

    def _add(self, tracks: TrackFile, prefix: str) -> States:
        """Describe the objects of one file and return their states, one for each row of the file."""
        offset = max((d.object_id for d in self.descriptions), default=0)
        people = _is_people(tracks.path)
        kind: str
        shape: Shape
        kind, shape = ("person", PERSON) if people else ("cart", CART)
        for track in np.unique(tracks.id):
            self.descriptions.append(ObjectDescription(offset + int(track), shape, f"{prefix}{kind}_{track}"))
        states = state_array((tracks.id + offset).astype(np.uint32))
        states["position"][:, :2] = tracks.values[:, :2]
        if people:
            states["position"][:, 2] = PERSON_HEIGHT / 2
            states["linear"][:, :2] = tracks.values[:, 2:]
        else:
            _write_carts(states, tracks)
        for track in np.unique(tracks.id):
            own = np.flatnonzero(tracks.id == track)
            states["flags"][own[1:]] = np.where(np.diff(tracks.frame[own]) > 1, StateFlag.DISCONTINUITY, 0)
        return states

    def _advance(self, dt: float) -> None:
        """Do nothing, because `states` looks `time` up."""

    def states(self) -> States:
        """Return the states of the last frame, extrapolated at their twists by the time since that frame."""
        now = self.time * FRAME_RATE
        frame = int(now + TIME_ROUND_OFF * FRAME_RATE)
        first, last = np.searchsorted(self._frame, [frame, frame + 1])
        states = self._row[first:last].copy()
        since = max(now - frame, 0.0) / FRAME_RATE
        if since > TIME_ROUND_OFF:
            states["position"] += states["linear"] * since
            turned = from_rotation_vector(states["angular"] * since)
            states["quaternion"] = multiply(turned, states["quaternion"])
            states["flags"] = 0  # the discontinuity is reported only once, in the frame itself
        return states


def clip_paths(path: Path) -> list[Path]:
    """Paths of the clips at `path`, one for each clip. Raises InputError if there are none."""
    return [path] if not found_instead(path) else [_prefix(clip[0]) for clip in _find_clips(path)]


def track_files(path: Path | None) -> list[Path]:
    """Files of all clips at `path`; none if there are no tracks."""
    with suppress(InputError):
        return [file for clip in _find_clips(path) for file in clip]
    return []


def _prefix(file: Path) -> Path:
    """Common path prefix of the clip that the file belongs to."""
    return file.with_name(file.name.removesuffix(_PEOPLE).removesuffix(_CARTS))


def _write_carts(states: States, tracks: TrackFile) -> None:
    """Write heading, velocity along it, and the yaw rate, which is not recorded: central differences of psi."""
    psi, speed = tracks.values[:, 2], tracks.values[:, 3]
    states["position"][:, 2] = CART_HEIGHT / 2
    states["quaternion"] = from_rotation_vector(psi[:, None] * np.array([0.0, 0.0, 1.0]))
    states["linear"][:, 0] = speed * np.cos(psi)
    states["linear"][:, 1] = speed * np.sin(psi)
    for track in np.unique(tracks.id):
        own = np.flatnonzero(tracks.id == track)
        if len(own) > 1:
            states["angular"][own, 2] = np.gradient(np.unwrap(psi[own]), tracks.frame[own] / FRAME_RATE)


def _is_people(file: Path) -> bool:
    return file.name.endswith(_PEOPLE)


def _find_clips(path: Path | None) -> list[list[Path]]:
    """Files of each clip, people first. Raises InputError with the accepted kinds of paths."""
    give = f"a clip's prefix (clip for clip{_PEOPLE} and clip{_CARTS}), one of these files, or a folder of them"
    if path is None:
        raise InputError(f"path: the scene 'trajectory' plays recorded tracks; give {give}")
    found = found_instead(path)
    if not found:
        if not path.name.endswith((_PEOPLE, _CARTS)):
            raise InputError(f"path: expected a file named *{_PEOPLE} or *{_CARTS}, got {path}")
        return [[path]]
    if found == FOLDER:
        files = [file for ending in (_PEOPLE, _CARTS) for file in sorted(path.glob(f"*{ending}"))]
        prefixes = sorted({_prefix(file).name for file in files})
        clips = [[f for f in files if f.name in (prefix + _PEOPLE, prefix + _CARTS)] for prefix in prefixes]
    elif found != NOTHING:
        raise InputError(f"path: expected {give}, got {found}: {path}")
    else:
        files = [path.with_name(path.name + ending) for ending in (_PEOPLE, _CARTS)]
        clips = [[file for file in files if not found_instead(file)]]
    if not any(clips):
        raise InputError(f"path: found no tracks at {path}; expected {give}")
    return clips
