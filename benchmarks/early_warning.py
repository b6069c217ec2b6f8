"""Measure how early, how often and how wrongly the monitor warns of real people and carts in recorded clips.

At every frame the monitor predicts the pairs that come within a clearance of each other. The recording shows the pairs
that did. With uncertainty, each object declares the deviation of its kind from the stated motion in the *other* clips.
Prints a Markdown table, with the velocities of the files, and with those of carts from their positions of WINDOW s.

    python benchmarks/early_warning.py ../shared/data/citr
    python benchmarks/early_warning.py ../shared/data/citr --png docs/images/early_warning.png
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import collision_monitor as cm
from collision_monitor.accuracy.calibration.deviation import LAGS, Growth, growth_of
from collision_monitor.accuracy.calibration.tracks import estimated_states
from collision_monitor.narrow_phase.dispatch import contact_batch
from collision_monitor.records import StateFlag
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import rotation_matrix
from collision_monitor.shapes.shape_table import ShapeTableBuilder
from collision_monitor.sources.ground.twist_estimate import TwistEstimator
from collision_monitor.world.recorded_tracks import FRAME_RATE, RecordedTracks

Array = NDArray[np.float64]
HORIZONS = (0.5, 1.0, 2.0)
THRESHOLDS = (0.1, 0.3, 0.5)
WINDOW = 0.2
"""s of the positions that give a velocity: what `collision-monitor calibrate` chooses for these clips."""


@dataclass(frozen=True)
class Strayings:
    """Variances of the deviation along one axis at LAGS (m²), of one kind of object in one clip.

    count: number of deviations at the last lag.
    """

    variance: Array
    count: int


@dataclass(frozen=True)
class Clip:
    """states: for each frame. distance (F, P): of each pair in each frame (m), NaN if an object is not tracked."""

    name: str
    scene: RecordedTracks
    states: list[NDArray[np.void]]
    pairs: list[tuple[int, int]]
    distance: Array


@dataclass(frozen=True)
class Reported:
    """Predictions of one clip at one horizon, (F, P): warnings from the stated motions alone; the probabilities."""

    stated: NDArray[np.bool_]
    probability: Array


def load(prefix: Path, *, from_positions: bool) -> Clip:
    """Read all frames of a clip, and compute the distances of all pairs. from_positions: velocities of the carts."""
    scene = RecordedTracks(None, None, prefix)
    frames = round(scene.duration * FRAME_RATE) + 1
    states = []
    for frame in range(frames):
        scene.time = frame / FRAME_RATE
        states.append(scene.states())
    ids = [d.object_id for d in scene.descriptions]
    if from_positions:
        states = estimated(states, [d.object_id for d in scene.descriptions if "cart" in d.name])
    pairs = list(combinations(sorted(ids), 2))
    builder = ShapeTableBuilder()
    slot = {d.object_id: builder.append(*d.shapes[0]) for d in scene.descriptions}
    distance = np.full((frames, len(pairs)), np.nan)
    position, rotation = np.zeros((len(ids), 3)), np.tile(np.eye(3), (len(ids), 1, 1))
    for frame, rows in enumerate(states):
        here = [slot[i] for i in rows["id"].tolist()]
        position[here], rotation[here] = rows["position"], rotation_matrix(rows["quaternion"])
        known = set(rows["id"].tolist())
        both = [k for k, (a, b) in enumerate(pairs) if a in known and b in known]
        slots = np.array([[slot[i] for i in pairs[k]] for k in both], np.int32).reshape(-1, 2)
        distance[frame, both] = contact_batch(builder.table, position, rotation, slots)[:, 0]
    return Clip(prefix.name, scene, states, pairs, distance)


def estimated(frames: list[NDArray[np.void]], ids: list[int]) -> list[NDArray[np.void]]:
    """The states, those of some objects with velocities from their positions where they have two."""
    estimator, slots = TwistEstimator(), {i: k for k, i in enumerate(ids)}
    estimator.grow(len(ids))
    found = []
    for frame, states in enumerate(frames):
        chosen = np.isin(states["id"], ids)
        unknown = estimated_states(states[chosen], slots, round(frame / FRAME_RATE * 1e9), WINDOW, estimator)
        first = (unknown["flags"] & StateFlag.TWIST_UNKNOWN) != 0
        unknown[first] = states[chosen][first]
        unknown["velocity_stddev"] = unknown["angular_velocity_stddev"] = 0.0
        whole = states.copy()
        whole[chosen] = unknown
        found.append(whole)
    return found


def strayings(clip: Clip, kind: str) -> Strayings:
    """Deviations of objects of a kind from the positions that their twist predicts."""
    ids = {d.object_id for d in clip.scene.descriptions if kind in d.name}
    tracks: dict[int, dict[int, np.void]] = {i: {} for i in ids}
    for frame, rows in enumerate(clip.states):
        for row in rows:
            if int(row["id"]) in ids:
                tracks[int(row["id"])][frame] = row
    variance, count = [], 0
    for lag in LAGS:
        n = round(lag * FRAME_RATE)
        off = [
            track[frame + n]["position"] - row["position"] - row["linear"] * n / FRAME_RATE
            for track in tracks.values()
            for frame, row in track.items()
            if frame + n in track
        ]
        variance.append(np.mean(np.array(off)[:, :2] ** 2))
        count = len(off)
    return Strayings(np.array(variance), count)


def fit(all_of: list[Strayings]) -> Growth:
    """Standard deviations of position, velocity and acceleration with the best relative fit to the variances."""
    variance = np.average([s.variance for s in all_of], axis=0, weights=[s.count for s in all_of])
    return growth_of(variance, np.array(LAGS))


def watch(clip: Clip, horizon: float, clearance: float, sigmas: dict[str, Growth] | None) -> Array:
    """Predictions at each frame (F, P): the probability if `sigmas` are declared, else 1 for a warning."""
    profile = Profile.named("balanced").replace(horizon=horizon, contact_margin=clearance)
    monitor = cm.Monitor(profile)
    kind_of = {}
    for d in clip.scene.descriptions:
        kind = kind_of[d.object_id] = "cart" if "cart" in d.name else "person"
        bound = sigmas[kind].most_acceleration if sigmas else 0.0
        monitor.describe(replace(d, max_linear_acceleration=bound))
    column = {pair: k for k, pair in enumerate(clip.pairs)}
    reported = np.zeros_like(clip.distance)
    for frame, rows in enumerate(clip.states):
        states = rows.copy()
        if sigmas:
            of = np.array([sigmas[kind_of[i]] for i in rows["id"].tolist()]).reshape(-1, 3)
            states["position_stddev"], states["velocity_stddev"] = of[:, 0], of[:, 1]
        for p in monitor.step(round(frame / FRAME_RATE * 1e9), states).predictions:
            if not p["stale"]:
                reported[frame, column[int(p["id_a"]), int(p["id_b"])]] = p["probability"] if sigmas else 1.0
    return reported


@dataclass
class Score:
    """Counts over moments. A moment is a pair in a frame that is apart now and tracked for the whole horizon."""

    near: int = 0
    warned: int = 0
    right: int = 0
    encounters: int = 0
    warned_encounters: int = 0
    alerts: int = 0
    seconds: float = 0.0

    def __post_init__(self) -> None:
        self.leads: list[float] = []
        self.nearest: list[float] = []

    def add(self, clip: Clip, warned: NDArray[np.bool_], horizon: float, clearance: float) -> None:
        """Compare the warnings of a clip with its encounters."""
        n = round(horizon * FRAME_RATE)
        coming, judged = look_ahead(clip.distance, n, clearance)
        near = judged & (coming <= clearance)
        said = judged & warned
        self.near += int(near.sum())
        self.warned += int(said.sum())
        self.right += int((said & near).sum())
        self.nearest += (coming[said & ~near] - clearance).tolist()
        self.alerts += int((said[1:] & ~said[:-1]).sum())
        self.seconds += len(clip.distance) / FRAME_RATE
        apart = clip.distance > clearance
        for frame, pair in zip(*np.nonzero(apart[:-1] & (clip.distance[1:] <= clearance)), strict=True):
            begin = frame + 1
            if begin < n or not apart[begin - n : begin, pair].all():
                continue  # not tracked, or within the clearance shortly before
            quiet = np.flatnonzero(~warned[begin - n : begin, pair])
            lead = n - 1 - quiet[-1] if len(quiet) else n
            self.encounters += 1
            self.warned_encounters += lead > 0
            self.leads.append(lead / FRAME_RATE)

    def row(self, horizon: float, how: str) -> str:
        """Row of the Markdown table."""
        lead = np.median(self.leads) if self.leads else np.nan
        precision = self.right / self.warned if self.warned else np.nan
        off = np.median(self.nearest) if self.nearest else np.nan
        return (
            f"| {horizon:g} | {how} | {self.warned_encounters} of {self.encounters} | {lead:.2f} "
            f"| {100 * self.right / max(self.near, 1):.0f} % | {100 * precision:.0f} % | {off:.2f} "
            f"| {60 * self.alerts / self.seconds:.0f} |"
        )


def look_ahead(distance: Array, n: int, clearance: float) -> tuple[Array, NDArray[np.bool_]]:
    """Least distance in the n frames after each (m), and whether it is known and the pair is apart now, (F, P)."""
    coming = np.full_like(distance, np.nan)
    for frame in range(len(distance) - n):
        coming[frame] = distance[frame + 1 : frame + 1 + n].min(axis=0)  # NaN if one is lost meanwhile
    return coming, np.isfinite(coming) & (distance > clearance)


def draw(clips: list[Clip], said: dict[float, list[Reported]], clearance: float, path: Path) -> None:
    """Draw right warnings against encounters found, and stated probabilities against observed frequencies."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(10, 4.4), layout="constrained")
        left, right = figure.subplots(1, 2)
        levels = np.concatenate([[0.01, 0.02, 0.05], np.arange(0.1, 1.0, 0.1)])
        for horizon, color in zip(HORIZONS, ("tab:green", "tab:orange", "tab:blue"), strict=True):
            points = []
            for level in [*levels, None]:
                score = Score()
                for clip, reported in zip(clips, said[horizon], strict=True):
                    warned = reported.stated if level is None else reported.probability >= level
                    score.add(clip, warned, horizon, clearance)
                points.append((score.right / max(score.near, 1), score.right / max(score.warned, 1)))
            x, y = 100 * np.array(points).T
            left.plot(x[:-1], y[:-1], ".-", color=color, linewidth=1, label=f"{horizon:g} s, by probability")
            left.plot(x[-1], y[-1], "s", color=color, markersize=8, markerfacecolor="none", label="stated motion alone")
            p = np.concatenate([t.probability.ravel() for t in said[horizon]])
            happened, judged = [], []
            for clip in clips:
                coming, known = look_ahead(clip.distance, round(horizon * FRAME_RATE), clearance)
                happened.append((coming <= clearance).ravel())
                judged.append(known.ravel())
            use, came = np.concatenate(judged), np.concatenate(happened)
            edges = np.array([0.01, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0 + 1e-9])
            which = np.digitize(p[use], edges)
            bins = [k for k in range(1, len(edges)) if (which == k).sum() >= 20]
            right.plot(
                [p[use][which == k].mean() for k in bins], [came[use][which == k].mean() for k in bins],
                "o-", color=color, linewidth=1, markersize=4, label=f"{horizon:g} s ahead",
            )  # fmt: skip
        left.set_xlabel("moments before an encounter with a warning, %")
        left.set_ylabel("warnings that came true, %")
        left.set_xlim(0, 102)
        left.set_ylim(0, 102)
        left.legend(frameon=False)
        right.plot([0, 1], [0, 1], color="0.6", linewidth=0.8)
        right.set_xlabel("stated probability")
        right.set_ylabel(f"part that came within {clearance:g} m")
        right.legend(frameon=False)
        figure.savefig(path, dpi=110)


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of clips: NAME_ped.csv and NAME_veh.csv")
    parser.add_argument("--clearance", type=float, default=0.5, help="m between surfaces; closer is an encounter")
    parser.add_argument("--png", type=Path)
    args = parser.parse_args()
    prefixes = sorted({f.with_name(f.name.removesuffix("_ped.csv")) for f in args.folder.glob("*_ped.csv")})
    if len(prefixes) < 2:
        parser.error(f"folder: expected at least two clips NAME_ped.csv, found {len(prefixes)} in {args.folder}")
    for from_positions in (False, True):
        clips = [load(prefix, from_positions=from_positions) for prefix in prefixes]
        print(f"\nvelocities of {f'carts from their positions of {WINDOW:g} s' if from_positions else 'the files'}\n")
        said = compare(clips, args.clearance)
        if args.png and from_positions:
            draw(clips, said, args.clearance, args.png)


def compare(clips: list[Clip], clearance: float) -> dict[float, list[Reported]]:
    """Print the table of the clips; return what was predicted at each horizon."""
    strayed = [{kind: strayings(clip, kind) for kind in ("person", "cart")} for clip in clips]
    declared = [
        {kind: fit([s[kind] for s in strayed if s is not own]) for kind in ("person", "cart")} for own in strayed
    ]
    for clip, of in zip(clips, declared, strict=True):
        values = "; ".join(f"{kind} {s[0]:.2f} m, {s[1]:.2f} m/s, {s[2]:.2f} m/s²" for kind, s in of.items())
        print(f"{clip.name}: {len(clip.states)} frames, declared from the other clips: {values}")
    print(
        f"\n| s ahead | warned | encounters within {clearance:g} m | median lead (s) | moments found "
        "| warnings right | wrong ones missed by (m) | alerts a minute |\n|---:|---|---:|---:|---:|---:|---:|---:|"
    )
    said: dict[float, list[Reported]] = {}
    for horizon in HORIZONS:
        said[horizon] = [
            Reported(watch(c, horizon, clearance, None) > 0.0, watch(c, horizon, clearance, sigmas))
            for c, sigmas in zip(clips, declared, strict=True)
        ]
        for threshold in (None, *THRESHOLDS):
            score = Score()
            for clip, reported in zip(clips, said[horizon], strict=True):
                warned = reported.stated if threshold is None else reported.probability >= threshold
                score.add(clip, warned, horizon, clearance)
            print(score.row(horizon, "stated motion alone" if threshold is None else f"probability ≥ {threshold:g}"))
    return said


if __name__ == "__main__":
    main()
