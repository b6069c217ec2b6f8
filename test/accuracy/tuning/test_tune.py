"""Tests of tuning: the cheapest profile that meets the demands, its parameter file, and the failed demands."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import session_scene
import yaml

from collision_monitor.accuracy import inputs
from collision_monitor.accuracy.inputs import Workload
from collision_monitor.accuracy.tradeoff.measurement import Errors
from collision_monitor.accuracy.tradeoff.profile_tradeoff import exact_answers, profile_tradeoff
from collision_monitor.accuracy.tuning import search_time
from collision_monitor.accuracy.tuning.candidates import Space, models_of, with_threads
from collision_monitor.accuracy.tuning.demands import Demands
from collision_monitor.accuracy.tuning.halving import Trial, rungs_of
from collision_monitor.accuracy.tuning.parallel_measurement import MOST_TRUTHS, TuningInputs
from collision_monitor.accuracy.tuning.tune import explain, parameter_file, space_of, tune
from collision_monitor.cli.main import main
from collision_monitor.cli.options.parameter_file import check_parameter_file
from collision_monitor.codec import encode_descriptions, encode_states
from collision_monitor.errors import InputError
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, ConvexHull, HalfSpace, Sphere
from collision_monitor.world.scene import state_array

GOLDEN = Path(__file__).parents[2] / "golden" / "balanced.mcap"
PROGRAM = Path(sys.executable).with_name("collision-monitor")


@pytest.fixture(scope="module")
def work() -> Workload:
    return inputs.recorded(GOLDEN)


@pytest.fixture(scope="module")
def tuned(work: Workload):
    done = []
    space = space_of(work, Profile(), Demands(ttc_error=0.01))
    # no run ends before its tile does, however busy the machine is
    found = tune(work, space, lambda name, total: nullcontext(done.append), jobs=1, run_seconds=60.0)
    assert sum(done) > len(found.trials)
    return found


def test_the_chosen_profile_is_the_cheapest_that_is_good_on_all_of_the_recording(tuned, work: Workload) -> None:
    taken = next(each for each in tuned.trials if each.profile is tuned.chosen)
    assert not taken.failures and taken.timed and taken.measurement.steps == len(work.steps)
    rivals = [each.measurement.step_ms for each in tuned.trials if each.timed and not each.failures]
    assert taken.measurement.step_ms <= 1.05 * min(rivals)
    assert all(bool(each.failures) == (each.measurement.ttc_error_s.p99 > 0.01) for each in tuned.trials)


def test_the_parts_of_a_recording_add_up_to_the_whole(tuned, work: Workload) -> None:
    """Each tile begins with a new monitor, so its first predictions are fresher, and never looser."""
    taken = next(each for each in tuned.trials if each.profile is tuned.chosen)
    (whole,) = profile_tradeoff(work.name, work.descriptions, work.steps, [tuned.chosen])
    assert (taken.measurement.misses, taken.measurement.outside_bound) == (whole.misses, whole.outside_bound) == (0, 0)
    assert taken.measurement.steps == whole.steps
    assert taken.measurement.alarms == pytest.approx(whole.alarms, rel=0.02)


def test_each_axis_of_a_profile_is_tried(tuned) -> None:
    names = " / ".join(each.profile.name for each in tuned.trials)
    for each in ("fast", "exact", "balanced × 100", "distance_tolerance", "impact_tolerance", "model_primitive obb"):
        assert each in names


def test_three_lines_say_why(tuned) -> None:
    assert [line.partition(":")[0] for line in tuned.reasons] == ["chosen", "cheaper", "dearer"]
    assert tuned.chosen.name in tuned.reasons[0]


def test_the_cost_of_probabilities_is_that_of_the_cheapest_profile_with_good_ones(tuned) -> None:
    """Not that of the chosen tolerances: as tight as those of `exact`, each sample would be followed exactly."""
    chosen = next(each for each in tuned.trials if each.profile is tuned.chosen)
    row, off = chosen.measurement, replace(chosen, profile=tuned.chosen.replace(uncertainty=False))

    def likely(name: str, step_ms: float, error: float) -> Trial:
        measured = replace(row, step_ms=step_ms, ttc_error_s=Errors(error, error, error))
        return replace(off, profile=Profile(name=name), measurement=measured, timed=False, failures=["step time"])

    dear = [likely("wrong", 2 * row.step_ms, 0.5), likely("right", 3 * row.step_ms, 0.0)]
    trials = [off, *dear, likely("tight", 99 * row.step_ms, 0.0)]
    demands = Demands(ttc_error=0.01, budget_ms=1.5 * row.step_ms)
    assert explain(off, trials, demands)[2] == "dearer: probabilities (right), 3 times the time; no demand needs them"


def test_it_is_said_which_demand_no_setting_meets_and_why(tuned) -> None:
    """A finer setting does not help against the noise of the states, which nothing said."""
    bad = [replace(each, failures=["bad"]) for each in tuned.trials]
    least = min(each.measurement.ttc_error_s.p99 for each in bad)
    hopeless = explain(None, bad, Demands(ttc_error=0.5 * least, distance_error=1e9))
    assert [line.partition(":")[0] for line in hopeless][1:-2] == ["no setting helps"]
    expected = f"no setting helps: TTC error of {0.5 * least:g} s: the least was {least:.3g} s; the states"
    assert hopeless[1].startswith(expected)
    possible = explain(None, bad, Demands(ttc_error=2.0 * least))
    assert not any(line.startswith("no setting helps") for line in possible)


def test_a_long_search_gets_shorter_runs(work: Workload, monkeypatch: pytest.MonkeyPatch) -> None:
    space = space_of(work, Profile(), Demands(ttc_error=0.01))
    plan = search_time.plan_search(work, space, 1)
    assert plan.run_seconds == search_time.RUN_SECONDS and 0.0 < plan.seconds < search_time.LONGEST
    monkeypatch.setattr(search_time, "LONGEST", 1e-3)
    assert search_time.plan_search(work, space, 1).run_seconds == search_time.SHORTEST_RUN


def test_the_exact_answers_to_a_few_tiles_are_kept(work: Workload) -> None:
    steps = [(round(k * 1e8), work.steps[k % len(work.steps)][1]) for k in range(25 * (MOST_TRUTHS + 2))]
    profile = Profile(uncertainty=False)
    recording = TuningInputs.cut(work.descriptions, steps, profile, [profile.horizon])
    assert recording.tiles == MOST_TRUTHS + 2
    (first,) = recording.measure(0, [profile], np.inf, lambda done: None)
    for tile in range(recording.tiles):
        recording.measure(tile, [profile], np.inf, lambda done: None)
        assert len(recording._truths) <= MOST_TRUTHS
        kept = recording._truth(tile, profile)
        assert kept is recording._truth(tile, profile)
        anew, _ = exact_answers(work.descriptions, recording.steps_of(tile), profile, lambda done: None)
        assert kept.predictions.tobytes() == anew.predictions.tobytes()
    (again,) = recording.measure(0, [profile], np.inf, lambda done: None)
    assert (again.steps, again.pairs) == (first.steps, first.pairs)


def test_each_demand_fails_with_its_measure(tuned) -> None:
    row = replace(
        tuned.trials[0].measurement,
        misses=0,
        outside_bound=0,
        distance_error_m=0.5,
        ttc_error_s=Errors(0.1, 0.2, 0.3),
        step_ms=2.0,
        step_ms_p99=8.0,
    )
    assert Demands().failures(row) == []
    assert Demands(0.1, 0.1, 4.0).failures(row) == [
        "distance error 0.5 m, 5 times the 0.1 m allowed",
        "TTC error 0.2 s, 2 times the 0.1 s allowed",
        "step time 8 ms, 2 times the 4 ms allowed",
    ]
    assert Demands(budget_ms=4.0).failures(row, median=True) == []
    assert Demands(0.1, 0.1, 4.0).excess(row) == 5.0
    assert Demands().failures(replace(row, misses=2)) == ["2 collisions missed"]
    none = replace(row, distance_error_m=float("nan"))
    assert Demands(distance_error=0.1).failures(none) == []


def test_a_demand_for_probabilities_keeps_uncertainty_on() -> None:
    space = Space(Profile(), Demands(probability_error=0.02), uncertain=True, models={})
    found = [*space.first_generation(), *space.variations(space.first_generation()[0])]
    assert found and all(each.uncertainty and 0.5 / each.uncertainty_samples**0.5 <= 0.02 for each in found)
    free = Space(Profile(), Demands(), uncertain=True, models={}).first_generation()
    assert {each.uncertainty for each in free} == {True, False}


def test_models_are_tried_only_where_all_objects_of_a_class_have_them() -> None:
    hull = ConvexHull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    objects = [ObjectDescription(1, Sphere(1)), ObjectDescription(2, HalfSpace((0, 0, 1), 0), static=True, pose=Pose())]
    objects += [ObjectDescription(3, Box((1, 1, 1))), ObjectDescription(4, hull, model="obb")]
    assert models_of(objects) == {"primitive": ("sphere", "obb", "kdop26", "convex_hull")}


def test_more_threads_are_at_most_one_for_each_core() -> None:
    assert [each.threads for each in with_threads(Profile(), 4)] == [2, 4]
    assert [each.threads for each in with_threads(Profile(threads=4), 16)] == [8, 16]
    assert with_threads(Profile(), 1) == []


def test_rungs_grow_to_all_tiles() -> None:
    assert rungs_of(16, 4) == [4, 8, 16]
    assert rungs_of(7, 4) == [4, 7]
    assert rungs_of(1, 4) == [1, 1]


WANTED = {
    "horizon": 1.5,
    "horizon_by_name": "pallet*=1, box_?=0.5",
    "rate_by_name": "pallet*=2",
    "contact_margin": 0.1,
    "contact_points": 4,
    "region_max": (5.0, 1e18, 1e18),
    "ignore_separating": True,
    "min_closing_speed": 0.2,
    "stale_after": 0.3,
}


def test_a_search_keeps_what_the_recorded_profile_wants() -> None:
    space = Space(Profile(**WANTED), Demands(horizon=0.75), uncertain=True, models={})
    first = space.first_generation()
    assert {name for each in first for name in WANTED if getattr(each, name) != WANTED[name]} == set()
    assert {each.adaptive_tolerances for each in space.variations(first[0])} == {True, False}
    shorter = [each for each in space.variations(first[0]) if each.horizon == 0.75]
    assert [each.horizon_by_name for each in shorter] == ["pallet*=0.75, box_?=0.5"]


def test_filters_and_a_region_are_no_misses(work: Workload) -> None:
    half = {"region_max": (0.0, 1e18, 1e18), "ignore_separating": True, "min_closing_speed": 0.5}
    whole, part = profile_tradeoff(
        work.name, work.descriptions, work.steps, [Profile(uncertainty=False), Profile(uncertainty=False, **half)]
    )
    assert 0 < part.compared < whole.compared
    assert (part.misses, part.outside_bound) == (0, 0)


def test_the_file_makes_the_profile_again(tmp_path: Path) -> None:
    space = Space(Profile(**WANTED), Demands(), uncertain=True, models={"primitive": ("obb",)})
    first = space.first_generation()
    for profile in [*first, *space.variations(first[3])]:
        text = parameter_file(profile, ["two", "lines"])
        assert text.startswith("# two\n# lines\n")
        (tmp_path / "tuned.yaml").write_text(text)
        check_parameter_file(tmp_path / "tuned.yaml")
        settings = yaml.safe_load(text)["/**/object_monitor"]["ros__parameters"]
        again = Profile.named(settings.pop("profile")).replace(**settings)
        assert again.replace(name=profile.name) == profile


@pytest.mark.parametrize(
    ("demands", "words"),
    [
        ({"budget_ms": 0.0}, "--budget-ms: expected a number above 0, got 0"),
        ({"probability_error": 0.001}, "--max-probability-error: expected 0.007812, with 4096 samples, to 0.5"),
        ({"horizon": 3.0}, "--min-horizon: expected at most that of the recording, 2 s, got 3 s"),
        ({"ttc_error": 2.5}, "--max-ttc-error: expected an error below the horizon of 2 s, got 2.5 s"),
        ({"probability_error": 0.1}, "--max-probability-error: expected states that declare an uncertainty, got none"),
    ],
)
def test_contradictory_demands_are_refused(work: Workload, demands: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        space_of(work, Profile(), Demands(**demands))


def test_the_command(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)

    def run(session: Path, *arguments: object) -> tuple[int, str, str]:
        code = main(["tune", str(session), "-j", "1", *map(str, arguments)])
        return code, *capsys.readouterr()

    command = [PROGRAM, "tune", GOLDEN, "--max-ttc-error", "0.05", "--png", "tried.png", "-j", "2"]
    good = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert good.returncode == 0, good.stderr
    assert "steps, about" in good.stderr
    assert "→ " in good.stdout and "\nchosen: " in good.stdout and "written balanced.yaml" in good.stdout
    check_parameter_file(tmp_path / "balanced.yaml")
    assert (tmp_path / "tried.png").read_bytes().startswith(b"\x89PNG")
    code, _, error = run(GOLDEN, "--max-ttc-error", 0.05)
    assert code == 1 and "--force" in error
    code, out, _ = run(recorded, "--budget-ms", 1e-6, "--json", "-o", "none.yaml")
    assert code == 3
    answer = json.loads(out)
    assert answer["chosen"] is None and answer["reasons"][0].startswith("none of")
    assert all("step time" in each["failures"][-1] for each in answer["rows"])
    assert any(each["profile"].endswith(", threads 2") for each in answer["rows"]) == (len(os.sched_getaffinity(0)) > 1)
    assert not (tmp_path / "none.yaml").exists()
    with pytest.raises(SystemExit) as wrong:
        run(GOLDEN, "--budget-ms", 0)
    assert wrong.value.code == 2


@pytest.fixture
def far_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Session of one step, in which two spheres rest far from each other."""
    objects = [ObjectDescription(k, Sphere(0.5)) for k in (1, 2)]
    states = state_array(np.array([1, 2], np.uint32))
    states["position"][1, 0] = 50.0
    messages = [
        (session_scene.SHAPES, encode_descriptions(session_scene.START, "world", objects, snapshot=True)),
        (session_scene.STATES, encode_states(session_scene.START, "world", 1, states)),
    ]
    monkeypatch.setattr(session_scene, "inputs", lambda steps: messages)
    session_scene.record(tmp_path / "far.mcap")
    return tmp_path / "far.mcap"


def test_a_demand_that_no_answer_tests_is_not_known_to_be_met(
    far_apart: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["tune", str(far_apart), "-j", "1000", "--max-ttc-error", "0.001", "--max-distance-error", "0.1"]) == 4
    out, error = capsys.readouterr()
    assert "--max-distance-error: the session has no contact, so that it could not be tested" in error
    assert "--max-ttc-error: the session has no certain prediction, so that" in error
    assert "meets what could be tested" in out and "meets all demands" not in out
    assert f" on {len(os.sched_getaffinity(0))} cores" in error
    assert not (tmp_path / "far.yaml").exists()
    assert main(["tune", str(far_apart), "-j", "1", "--budget-ms", "1000", "-o", "a file.yaml"]) == 0
    assert "collision-monitor run --params 'a file.yaml'" in capsys.readouterr().out


def test_wrong_demands_are_wrong_usage(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for arguments in (("--max-ttc-error", "3"), ("--min-horizon", "9"), ("--max-probability-error", "0.6")):
        assert main(["tune", str(GOLDEN), "-o", str(tmp_path / "new.yaml"), *arguments]) == 2
        assert f"error: {arguments[0]}: expected" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["tune", "tradeoff"])
def test_what_a_session_lacks_is_said(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(GOLDEN.read_bytes()[:60_000])
    options = {"tune": ["--min-horizon", "9"], "tradeoff": ["--profile", "fast"]}[command]  # no long search
    main([command, str(cut), *options])
    assert "missing: the recording was cut off" in capsys.readouterr().err
