"""Tests of `collision-monitor conflicts`: its table, JSON, picture, exit codes and errors."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import collision_monitor as cm
from collision_monitor.cli.main import main
from collision_monitor.codec import ObjectTrajectory, encode_descriptions, encode_trajectories
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.pipeline.topics import Topic
from collision_monitor.session import Recorder

EXAMPLE = Path(__file__).parents[2] / "examples" / "fleets"

CROSSING = """\
objects:
  north: {shape: {sphere: 0.5}, times: [100, 110], poses: [[0, -5, 0], [0, 5, 0]], headings: [1.57, 1.57]}
  east:  {shape: {sphere: 0.5}, times: [100, 110], poses: [[-5, 0, 0], [5, 0, 0]]}
"""
WORLD = "objects:\n  post: {static: true, shape: {box: [0.2, 0.2, 2]}, pose: [0, 4, 0]}\n"


def written(folder: Path, name: str, text: str) -> str:
    (folder / name).write_text(text)
    return str(folder / name)


def test_the_example_draws_a_picture_and_finds_conflicts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "conflicts.png"
    fleets = [str(EXAMPLE / name) for name in ("pickers.yaml", "tuggers.yaml")]
    world = ["--world", str(EXAMPLE / "hall.yaml"), "--png", str(picture)]
    assert main(["conflicts", *fleets, *world]) == 3
    out = capsys.readouterr().out.splitlines()
    assert max(map(len, out)) <= 80
    assert out[-1].startswith("20 plans, 27 static objects: 12 conflicts, 0 unresolved")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(["conflicts", *fleets, *world]) == 1  # the picture is there


def test_json_has_entries_and_exits_in_closed_form(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plans, world = written(tmp_path, "plans.yaml", CROSSING), written(tmp_path, "world.yaml", WORLD)
    assert main(["conflicts", plans, "--world", world, "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert (found["plans"], found["static"], found["begin_ns"], found["left_out"]) == (2, 1, 100 * 10**9, [])
    first, second = found["conflicts"]
    assert {first["a"], first["b"], second["a"], second["b"]} == {"north", "east", "post"}
    assert first["entry"] == pytest.approx([5.0 - 0.5**0.5] * 2, abs=1e-6)
    assert first["exit"] == pytest.approx([5.0 + 0.5**0.5] * 2, abs=1e-6)
    assert second["entry"] == pytest.approx([8.4] * 2, abs=1e-6) and second["point"] == pytest.approx(
        [0, 3.9, 0], abs=1e-6
    )
    assert main(["conflicts", plans, "--horizon", "3"]) == 0
    assert main(["conflicts", plans, "--separation", "0.5", "--horizon", "4"]) == 3
    capsys.readouterr()


def test_json_files_are_read_and_what_is_unknown_is_exit_code_4(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = {"shape": {"sphere": 0.5}, "times": [0, 1], "poses": [[0, 0, 0], [1, 0, 0]], "then": "unknown"}
    other = {"shape": {"sphere": 0.5}, "times": [0, 3], "poses": [[9, 0, 0], [9, 1, 0]]}
    file = written(tmp_path, "plans.json", json.dumps({"objects": {"a": plan, "b": other}}))
    assert main(["conflicts", file]) == 4
    out = capsys.readouterr().out
    assert "?" in out and "anything" in out and "0 conflicts, 1 unresolved" in out


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("objects: {}", "objects: expected a table of names"),
        ("objects:\n  a: {shape: {sphere: 1}, times: [0, 1]}", "line 2: a, poses: expected those of its plan"),
        ("objects:\n  a:\n    shape: {sphere: 1}\n    times: [1, 0]\n    poses: [[0, 0, 0], [1, 0, 0]]",
         "line 4: a, times: expected rising ones"),
        ("objects:\n  a: {shape: {spher: 1}, times: [0, 1], poses: []}", "line 2: a, shape: 'spher' is unknown"),
        ("objects:\n  a: {static: true, times: [0], shape: {sphere: 1}}", "a, times: expected none of a static object"),
        ("objects:\n  a: {shape: {sphere: 1}, times: [0, 1], poses: [[0, 0, 0]], headings: [0, 0]}", "a, headings"),
        ("objects:\n  a: {shape: {sphere: 1}, times: [0, .nan], poses: [[0, 0, 0], [1, 0, 0]]}", "a, times: expected"),
        (WORLD, "expected at least one plan, got none"),
        (f"{CROSSING}ignore: [[north]]", "ignore: expected a list of pairs"),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_used_is_refused_with_its_line(
    text: str, error: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["conflicts", written(tmp_path, "plans.yaml", text)]) == 1
    assert error in capsys.readouterr().err


def test_two_objects_of_one_name_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [written(tmp_path, name, CROSSING) for name in ("one.yaml", "two.yaml")]
    assert main(["conflicts", *files]) == 1
    assert "two.yaml, north: expected a name that no other object has" in capsys.readouterr().err


def session(path: Path) -> Path:
    """A session in which two carts get plans, at stamps 1 s apart, and a third one none."""
    pipeline = Pipeline("balanced", frame_id="map")
    shapes = [
        ObjectDescription(1, cm.Sphere(0.5), name="north"),
        ObjectDescription(2, cm.Sphere(0.5), name="east"),
        ObjectDescription(3, cm.Sphere(0.5), name="idle"),
        ObjectDescription(4, cm.Box((0.2, 0.2, 2)), name="post", static=True, pose=cm.Pose((0, 4, 0))),
    ]

    def plan(object_id: int, times: list[float], begin: tuple[float, ...], end: tuple[float, ...]) -> ObjectTrajectory:
        poses = np.array([[*begin, 0, 0, 0, 1], [*end, 0, 0, 0, 1]], float)
        return ObjectTrajectory(np.array(times), poses, np.zeros((0, 6)), np.zeros(4), object_id)

    shapes_topic, plans_topic = Topic.SHAPES.of(), Topic.TRAJECTORIES.of()
    messages = [
        (shapes_topic, encode_descriptions(0, "map", shapes)),
        (plans_topic, encode_trajectories(10**9, "map", [plan(1, [0, 10], (0, -5, 0), (0, 5, 0))])),
        (plans_topic, encode_trajectories(2 * 10**9, "map", [plan(2, [-1, 9], (-5, 0, 0), (5, 0, 0))])),
    ]
    types = {shapes_topic: Topic.SHAPES.message, plans_topic: Topic.TRAJECTORIES.message}
    recorder = Recorder(path, types, pipeline.metadata(), patient=True)
    for k, (topic, data) in enumerate(messages):
        recorder.write(topic, data, k, k)
    recorder.close()
    return path


def test_the_plans_of_a_session_are_compared_on_one_clock(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["conflicts", str(session(tmp_path / "run.mcap")), "--json"]) == 3
    found = json.loads(capsys.readouterr().out)
    assert (found["plans"], found["static"], found["begin_ns"]) == (2, 1, 10**9)
    assert len(found["left_out"]) == 1 and "idle: it has no plan" in found["left_out"][0]
    assert found["conflicts"][0]["entry"] == pytest.approx([5.0 - 0.5**0.5] * 2, abs=1e-6)
    assert found["conflicts"][1]["b"] == "post"
