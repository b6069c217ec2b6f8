"""Tests of recorded tracks: the real clips if they are present, clips written here, and invalid files."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from collision_monitor.errors import InputError
from collision_monitor.records import StateFlag
from collision_monitor.shapes.registry import Box, Cylinder
from collision_monitor.world import make_scene
from collision_monitor.world.recorded_tracks import FRAME_RATE

RECORDED = Path(__file__).parents[2].parent / "shared" / "data" / "citr"
PEOPLE = "id,frame,label,x_est,y_est,vx_est,vy_est\n"
CARTS = "id,frame,label,x_est,y_est,psi_est,vel_est\n"
WRITTEN = "written here"
CLIPS = [WRITTEN, *sorted(str(p).removesuffix("_veh.csv") for p in RECORDED.glob("*_veh.csv"))]


def write_clip(prefix):
    """Write 60 frames: two people who walk straight, and a cart on a circle through psi = +-pi."""
    t = np.arange(60) / FRAME_RATE
    with open(f"{prefix}_ped.csv", "w") as file:
        file.write(PEOPLE)
        for person in (1, 2):
            for k in range(60):
                file.write(f"{person},{100 + k},ped,{1.5 * t[k]},{person},1.5,0\n")
    with open(f"{prefix}_veh.csv", "w") as file:
        file.write(CARTS)
        for k in range(60):
            psi = (3.0 + 0.5 * t[k] + np.pi) % (2 * np.pi) - np.pi
            file.write(f"1,{100 + k},veh,{8 * np.sin(psi)},{-8 * np.cos(psi)},{psi},4\n")
    return Path(prefix)


@pytest.fixture
def clip(tmp_path):
    return write_clip(tmp_path / "clip")


@pytest.mark.parametrize("source", CLIPS, ids=lambda c: Path(c).name)
def test_a_clip_plays_with_sizes_and_velocities_that_fit_its_positions(source, tmp_path):
    path = write_clip(tmp_path / "clip") if source == WRITTEN else Path(source)
    scene = make_scene("trajectory", path=path)
    people = [d for d in scene.descriptions if d.name.startswith("person_")]
    carts = [d for d in scene.descriptions if d.name.startswith("cart_")]
    assert people
    assert carts
    assert len({d.object_id for d in scene.descriptions}) == len(people) + len(carts)
    assert {d.shapes[0][0] for d in people} == {Cylinder(0.25, 1.75)}
    assert {d.shapes[0][0] for d in carts} == {Box((2.4, 1.2, 1.8))}

    history = [scene.states()]
    while not scene.finished:
        history.append(scene.step())
    history.pop()  # the step past the end
    assert len(history) == round(scene.duration * FRAME_RATE) + 1
    assert all(len(states) == len(scene.descriptions) for states in history)  # these clips have no gaps

    position = np.array([s["position"] for s in history])
    linear = np.array([s["linear"] for s in history])
    went, said = position[-1] - position[0], linear.mean(axis=0) * scene.duration
    off = np.linalg.norm(went - said, axis=1)
    assert (off < 0.2 * np.linalg.norm(went, axis=1)).all()  # recorded velocities are filtered and lag behind
    assert position[..., 2].min() == 0.875
    assert position[..., 2].max() == 0.9
    cart = scene.descriptions.index(carts[0])
    yaw = np.unwrap([2 * np.arctan2(s["quaternion"][cart, 2], s["quaternion"][cart, 3]) for s in history])
    yaw_rate = np.array([s["angular"][cart, 2] for s in history])
    assert yaw_rate[1:-1] == pytest.approx((yaw[2:] - yaw[:-2]) * FRAME_RATE / 2, abs=1e-6)


def test_the_files_numbers_come_through(clip):
    scene = make_scene("trajectory", path=clip)
    assert [(d.object_id, d.name) for d in scene.descriptions] == [(1, "person_1"), (2, "person_2"), (3, "cart_1")]
    assert scene.rate == FRAME_RATE
    states = scene.states()
    for _ in range(30):
        states = scene.step()
    t = 30 / FRAME_RATE
    assert states["id"].tolist() == [1, 2, 3]
    assert states["position"][0] == pytest.approx([1.5 * t, 1.0, 0.875])
    assert states["linear"][0].tolist() == [1.5, 0.0, 0.0]
    psi = 3.0 + 0.5 * t
    assert states["linear"][2] == pytest.approx([4 * np.cos(psi), 4 * np.sin(psi), 0.0])
    assert states["angular"][2] == pytest.approx([0.0, 0.0, 0.5])


def test_another_rate_moves_on_between_the_frames(clip):
    scene = make_scene("trajectory", path=clip, rate=100.0)
    for k in range(1, 150):
        assert scene.step()["position"][0, 0] == pytest.approx(1.5 * k / 100.0, abs=1e-9)


def test_a_clip_may_be_people_alone_or_one_file(clip):
    one = make_scene("trajectory", path=clip.with_name("clip_veh.csv"))
    assert [d.name for d in one.descriptions] == ["cart_1"]
    clip.with_name("clip_veh.csv").unlink()
    assert len(make_scene("trajectory", path=str(clip)).states()) == 2


def test_a_folder_plays_its_clips_one_after_another(clip):
    for kind in ("ped", "veh"):
        shutil.copy(f"{clip}_{kind}.csv", clip.with_name(f"later_{kind}.csv"))
    scene = make_scene("trajectory", path=clip.parent)
    assert [d.object_id for d in scene.descriptions] == [1, 2, 3, 4, 5, 6]
    assert [d.name for d in scene.descriptions][2:4] == ["clip/cart_1", "later/person_1"]
    assert scene.duration == pytest.approx((59 + 30 + 59) / FRAME_RATE)
    seen = [scene.states()["id"].tolist()] + [scene.step()["id"].tolist() for _ in range(148)]
    assert seen == [[1, 2, 3]] * 60 + [[]] * 29 + [[4, 5, 6]] * 60


def test_who_is_not_tracked_has_no_state_and_comes_back_flagged(tmp_path):
    rows = ["1,5,ped,0,0,1,0", "1,6,ped,0.1,0,1,0", "1,9,ped,5,0,1,0", "1,10,ped,5.1,0,1,0", "2,8,ped,0,3,0,0"]
    (tmp_path / "gap_ped.csv").write_text(PEOPLE + "\n".join(rows) + "\n")
    scene = make_scene("trajectory", path=tmp_path / "gap")
    assert len(scene.descriptions) == 2
    history = [scene.states()] + [scene.step() for _ in range(5)]
    assert [s["id"].tolist() for s in history] == [[1], [1], [], [2], [1], [1]]
    assert [s["flags"].tolist() for s in history] == [[0], [0], [], [0], [StateFlag.DISCONTINUITY], [0]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty file"),
        ("\n", "empty file"),
        (PEOPLE, "expected rows"),
        ("id,frame,x_est,y_est\n1,1,0,0\n", r"vx_est, vy_est are missing; there are id, frame, x_est, y_est"),
        (PEOPLE + "1,1,ped,0,0,0,0\n1,2,ped,0,zero,0,0\n", r"line 3, column y_est: expected a number, got 'zero'"),
        (PEOPLE + "1,1,ped,0,0,0,nan\n", r"line 2, column vy_est: expected a finite number"),
        (PEOPLE + "1,1,ped,0,,0,0\n", r"line 2, column y_est: expected a number, got ''"),
        (PEOPLE + "1.5,1,ped,0,0,0,0\n", r"line 2, column id: expected a whole number"),
        (PEOPLE + "1,99999999999999999999,ped,0,0,0,0\n", r"line 2, column frame: expected a whole number"),
        (PEOPLE + "1,-1,ped,0,0,0,0\n", r"line 2, column frame"),
        (PEOPLE + "1,1,ped,0,0\n", r"line 2: expected 7 cells as in the header, got 5"),
        (PEOPLE + "1,2,ped,0,0,0,0\n1,1,ped,0,0,0,0\n", r"line 3: expected the frames of id 1 to rise, got 1 after 2"),
        (PEOPLE + "1,2,ped,0,0,0,0\n1,2,ped,0,0,0,0\n", r"got 2 after 2"),
    ],
)
def test_a_bad_file_is_refused_with_file_line_and_column(tmp_path, text, said):
    (tmp_path / "bad_ped.csv").write_text(text)
    with pytest.raises(InputError, match=rf"bad_ped\.csv.*{said}"):
        make_scene("trajectory", path=tmp_path / "bad")


@pytest.mark.parametrize("data", [b"\xff\xfe\x00id", b"id,frame\x00,x\n", b"\x89PNG\r\n\x1a\n" + bytes(100)])
def test_a_file_that_is_no_text_is_refused(tmp_path, data):
    (tmp_path / "bad_ped.csv").write_bytes(data)
    with pytest.raises(InputError, match=r"bad_ped\.csv"):
        make_scene("trajectory", path=tmp_path / "bad")


def test_no_path_and_wrong_paths_say_what_to_give(tmp_path):
    with pytest.raises(InputError, match="a clip's prefix"):
        make_scene("trajectory")
    with pytest.raises(InputError, match="found no tracks"):
        make_scene("trajectory", path=tmp_path / "nothing")
    with pytest.raises(InputError, match="found no tracks"):
        make_scene("trajectory", path=tmp_path)
    (tmp_path / "other.csv").write_text(PEOPLE)
    with pytest.raises(InputError, match=r"_ped\.csv or \*_veh\.csv"):
        make_scene("trajectory", path=tmp_path / "other.csv")
    with pytest.raises(InputError, match="plays the recorded objects"):
        make_scene("trajectory", objects=3, path=tmp_path)
