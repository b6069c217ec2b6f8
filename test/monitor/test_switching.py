"""A profile that changes while the monitor runs: nothing is lost, and the new profile holds from then on."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from started_threads import StartedThreads

from collision_monitor import records
from collision_monitor.accuracy.reference_monitor import ReferenceMonitor, disagreements
from collision_monitor.errors import ProfileError
from collision_monitor.monitor.monitor import Monitor
from collision_monitor.monitor.result import StepResult
from collision_monitor.records import Model
from collision_monitor.settings.profile import Profile
from collision_monitor.shapes.pose import Pose
from collision_monitor.shapes.registry import Box, ConvexHull, Cylinder, HalfSpace, Mesh, Points, Sphere
from collision_monitor.world import make_scene

SECOND = 1_000_000_000
OTHER: dict[str, Any] = {
    "horizon": 3.5,
    "horizon_by_name": "*1=0.5",
    "rate_by_name": "*2=5",
    "contact_margin": 0.05,
    "contact_points": 4,
    "contact_details": False,
    "distance_tolerance": 1e-3,
    "impact_tolerance": 1e-6,
    "mesh_impact_tolerance": 0.05,
    "impact_iterations": 200,
    "position_tolerance": 1e-2,
    "orientation_tolerance": 1e-2,
    "velocity_tolerance": 1e-2,
    "angular_velocity_tolerance": 1e-2,
    "adaptive_tolerances": False,
    "stale_after": 0.1,
    "stale_acceleration": 2.0,
    "uncertainty": False,
    "uncertainty_samples": 128,
    "confidence": 0.99,
    "min_probability": 0.1,
    "max_time_step": 1.0,
    "threads": 2,
    "budget_ms": 1000.0,
    "pairs_per_step": 5,
    "model_primitive": "obb",
    "model_hull": "sphere",
    "model_mesh": "kdop14",
    "model_compound": "aabb",
    "model_error": 0.001,
    "region_min": (-3.0, -3.0, -3.0),
    "region_max": (3.0, 20.0, 3.0),
    "min_closing_speed": 0.5,
    "ignore_separating": True,
}


def phases(result: StepResult) -> set[int]:
    return set(result.contacts["phase"].tolist())


@pytest.mark.parametrize("profile", ["fast", "exact", Profile(contact_margin=0.02), Profile(horizon=0.0)])
def test_contacts_persist_and_keep_their_age(profile: str | Profile) -> None:
    scene = make_scene("clutter", objects=200)
    monitor = Monitor()
    for description in scene.descriptions:
        monitor.describe(description)
    states = scene.states()
    before = monitor.step(0, states)
    assert len(before.contacts) > 5
    monitor.profile = profile
    after = monitor.step(SECOND // 10, states)  # nothing has moved
    kept = np.isin(after.contacts[["id_a", "id_b"]], before.contacts[["id_a", "id_b"]])
    assert kept.sum() == len(before.contacts)
    assert set(after.contacts["phase"][kept].tolist()) == {records.Phase.PERSIST}
    assert np.allclose(after.contacts["duration"][kept], 0.1)
    assert kept.all() or monitor.profile.contact_margin > 0.0, "only a wider margin finds more"


@pytest.mark.parametrize("setting", Profile.fields(), ids=lambda setting: setting.name)
def test_every_setting_can_change_and_holds_from_then_on(setting: Any, started_threads: StartedThreads) -> None:
    """Compare with plain recomputation with the new profile, at every step after the change."""
    scene = make_scene("crossing")
    monitor, plain = Monitor("balanced"), ReferenceMonitor("balanced")
    for description in scene.descriptions:
        monitor.describe(description)
        plain.describe(description)
    changed = Profile().replace(**{setting.name: OTHER[setting.name]})
    reported = 0
    for step in range(60):
        if step == 30:
            monitor.profile = changed
            if not setting.name.endswith(("position_tolerance", "orientation_tolerance", "velocity_tolerance")):
                plain.profile = plain.profile.replace(**{setting.name: OTHER[setting.name]})
        states = scene.states()
        mine, truth = (each.step(step * SECOND // 20, states) for each in (monitor, plain))
        if setting.name == "pairs_per_step" and step >= 30:
            continue  # see test_time_critical.py
        assert disagreements(mine, truth, monitor.profile.horizon) == []
        reported += len(mine.predictions) + len(mine.contacts)
        scene.step(0.05)
    assert reported > 50
    assert monitor.profile == changed
    assert started_threads.most == (2 if setting.name == "threads" else 0)


def test_predictions_are_as_exact_as_the_new_profile() -> None:
    scene = make_scene("clutter")
    wide = {"velocity_tolerance": 0.04, "angular_velocity_tolerance": 0.04}
    monitor = Monitor(Profile.named("fast").replace(adaptive_tolerances=False, **wide))
    fresh = Monitor("exact")
    for description in scene.descriptions:
        monitor.describe(description)
        fresh.describe(description)
    rough = monitor.step(0, scene.states()).predictions
    monitor.profile = "exact"
    states = scene.step()
    result, expected = (each.step(round(scene.time * SECOND), states) for each in (monitor, fresh))
    for name in ("id_a", "id_b", "status"):
        assert np.array_equal(result.predictions[name], expected.predictions[name])
    for name in ("lower", "upper"):  # the search covers another interval, so the last bits differ
        assert np.allclose(result.predictions[name], expected.predictions[name], atol=1e-5)
    certain = [p[p["status"] == records.PredictionStatus.HIT] for p in (rough, result.predictions)]
    before, after = (np.median(p["upper"] - p["lower"]) for p in certain)
    assert before > 1e3 * after


def test_without_a_horizon_contacts_are_found() -> None:
    scene = make_scene("clutter")
    full, contacts_only = Monitor(), Monitor(Profile(horizon=0.0))
    for description in scene.descriptions:
        full.describe(description)
        contacts_only.describe(description)
    for step in range(20):
        states = scene.step()
        mine, expected = (each.step(step * SECOND // 50, states) for each in (contacts_only, full))
        assert np.array_equal(mine.contacts.view(np.uint8), expected.contacts.view(np.uint8))
        assert len(mine.contacts) > 5


@pytest.mark.parametrize("profile", ["balanced", "fast"])
def test_without_a_horizon_contacts_of_meshes_and_clouds_are_found(profile: str) -> None:
    """The window in which an impact is sought is an instant then."""
    ring = trimesh.creation.torus(0.5, 0.2, major_sections=12, minor_sections=6)
    mesh, cloud = Mesh(ring.vertices, ring.faces), Points(ring.vertices, 0.01)
    others = [mesh, cloud, Sphere(0.5), Box((1, 1, 1)), Cylinder(0.5, 1)]
    monitor = Monitor(Profile.named(profile).replace(horizon=0.0))
    poses = []
    for k, (a, b) in enumerate(product((mesh, cloud), others)):  # ten pairs that overlap, far from each other
        for shape, x in ((a, 10.0 * k), (b, 10.0 * k + 0.4)):
            monitor.add(len(poses), shape)
            poses.append([x, 0, 0, 0, 0, 0, 1])
    for step in range(3):
        result = monitor.step(step * SECOND // 50, range(len(poses)), poses)
        assert len(np.unique(result.contacts[["id_a", "id_b"]])) == len(poses) // 2


def test_a_horizon_that_shrinks_takes_back_what_is_beyond_it() -> None:
    monitor = Monitor()
    monitor.add(1, Sphere(0.5))
    monitor.add(2, Sphere(0.5))
    poses = np.array([[0, 0, 0, 0, 0, 0, 1.0], [2.5, 0, 0, 0, 0, 0, 1.0]])
    twists = np.array([[1.0, 0, 0, 0, 0, 0], [0.0] * 6])
    found = []
    for k, horizon in enumerate((2.0, 1.0, 2.0, 0.0, 4.0)):
        monitor.profile = monitor.profile.replace(horizon=horizon)
        found.append(len(monitor.step(k, [1, 2], poses, twists).predictions))
    assert found == [1, 0, 1, 0, 1]


def test_switching_by_name_keeps_what_the_profile_does_not_name() -> None:
    monitor = Monitor(Profile(horizon=7.0, threads=2))
    monitor.profile = "fast"
    assert monitor.profile == Profile.named("fast").replace(horizon=7.0, threads=2)
    monitor.profile = "balanced"
    assert monitor.profile == Profile(horizon=7.0, threads=2)


def test_uncertainty_can_be_switched_off_and_on() -> None:
    monitor, certain = Monitor(), Monitor()
    found = []
    for each in (monitor, certain):
        each.add(1, Sphere(0.5))
        each.add(2, Sphere(0.5))
    for step, uncertainty in enumerate((True, False, True)):
        monitor.profile = monitor.profile.replace(uncertainty=uncertainty)
        states = np.zeros(2, records.STATE)
        states["id"], states["quaternion"][:, 3] = (1, 2), 1.0
        states["position"][1], states["linear"][0] = (2.0, 1.05, 0.0), (1.0, 0.0, 0.0)  # they pass 5 cm apart
        plain = certain.step(step, states).predictions
        states["position_stddev"] = 0.1
        predictions = monitor.step(step, states).predictions
        found.append(len(predictions) - len(plain))
    assert found == [1, 0, 1]


def test_the_model_of_a_class_stands_for_what_chooses_none() -> None:
    profile = Profile(model_primitive="sphere", model_hull="obb", model_mesh="kdop14", model_compound="aabb")
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    box = Box((1, 2, 3))
    shapes: list[tuple[Any, Model]] = [
        (box, Model.SPHERE),
        (ConvexHull(corners), Model.OBB),
        (Mesh(corners, faces), Model.KDOP14),
        ([(box, Pose()), (Sphere(0.2), Pose((2, 0, 0)))], Model.AABB),
        (Sphere(0.5), Model.EXACT),
    ]
    monitor = Monitor(profile)
    for object_id, (shape, _) in enumerate(shapes):
        monitor.add(object_id, shape)
        monitor.add(10 + object_id, shape, model=Model.KDOP26)
    monitor.add(20, HalfSpace((0, 0, 1), 0.0), static=True, pose=Pose())
    poses = np.zeros((10, 7))
    poses[:, 6] = 1.0  # all in one place: all pairs touch
    ids = [*range(5), *range(10, 15)]
    models: dict[int, int] = {}
    for contact in monitor.step(0, ids, poses).contacts:
        models |= {int(contact[f"id_{side}"]): int(contact[f"model_{side}"]) for side in "ab"}
    assert [models[k] for k in range(5)] == [model for _, model in shapes]
    assert {models[10 + k] for k in range(5)} == {Model.KDOP26}, "its own choice wins"
    assert models[20] == Model.EXACT
    with pytest.raises(ProfileError, match=r"model_mesh: expected one of auto, sphere, .*, got 'exact'"):
        Profile(model_mesh="exact")


class TestCustomProfiles:
    def write(self, folder: Path, text: str) -> str:
        path = folder / "site.yaml"
        path.write_text(text)
        return str(path)

    def test_a_file_names_what_differs(self, tmp_path: Path) -> None:
        profile = Profile.named(self.write(tmp_path, "based_on: fast\nhorizon: 3\n"))
        assert profile == Profile.named("fast").replace(name="site", horizon=3.0)

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("horizon: -1", "horizon: expected 0 to 1e\\+06 s, got -1"),
            ("horizn: 1", "expected settings among .*horizon.*, got 'horizn'"),
            ("based_on: hasty", "based_on: expected one of balanced, exact, fast, got 'hasty'"),
            ("threads: 1.5", "threads: expected a whole number, got 1.5"),
            ("horizon: true", "horizon: expected a number of seconds, got True"),
            ("- horizon", "expected settings, as `horizon: 3.0`"),
            ("", "expected settings"),
            ("a: [", "expected YAML"),
            ("1: 2", "keywords must be strings"),
            ("name: 3", "name: expected a text, got 3"),
        ],
    )
    def test_a_file_that_cannot_be_is_named_with_what_is_wrong(self, tmp_path: Path, text: str, words: str) -> None:
        with pytest.raises(ProfileError, match=words) as error:
            Profile.named(self.write(tmp_path, text))
        assert "site.yaml" in str(error.value)

    def test_no_file_and_no_profile(self) -> None:
        with pytest.raises(ProfileError, match=r"none\.yaml"):
            Profile.named("none.yaml")
        with pytest.raises(ProfileError, match=r"expected one of balanced, exact, fast, or a \.yaml file, got 'hasty'"):
            Monitor("hasty")


@pytest.mark.parametrize("name", Profile.names())
def test_the_profiles_in_config_are_those_of_their_name(name: str) -> None:
    path = Path(__file__).parents[2] / "config" / f"{name}.yaml"
    assert Profile.named(str(path)) == Profile.named(name)
