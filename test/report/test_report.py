"""The report of a session: its facts, and a page that holds them, alone and safely."""

from __future__ import annotations

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from collision_monitor import Pose, Sphere, contact, records
from collision_monitor.codec import encode_descriptions, encode_states
from collision_monitor.description import ObjectDescription
from collision_monitor.errors import SessionError
from collision_monitor.geometry.shapes import Box
from collision_monitor.pipeline import Pipeline
from collision_monitor.report import write_report
from collision_monitor.report.facts import gather, pair_distance
from collision_monitor.session import Recorder, Session
from collision_monitor.session.history import read_history

PROGRAM = Path(sys.executable).with_name("collision-monitor")
TOPICS = ["ObjectDescriptionArray", "ObjectStateArray", "ContactArray", "PredictedCollisionArray", "MonitorStatus"]
TYPES = {f"/m/{name}": name for name in TOPICS}
NASTY = "<script>alert('$x$ & y')</script>"


def record(path: Path, steps: int = 150) -> Path:
    """A cart drives into a post; a ball turns away before it would have been hit."""
    pipeline = Pipeline("exact")
    recorder = Recorder(path, TYPES, pipeline.metadata(node="/m"))

    def write(name: str, data: bytes, stamp: int) -> None:
        recorder.write(f"/m/{name}", data, stamp, stamp)

    objects = [
        ObjectDescription(1, [(Box((1, 0.6, 0.4)), Pose()), (Sphere(0.2), Pose((0.5, 0, 0)))], name=NASTY),
        ObjectDescription(2, Sphere(0.5), name="post", static=True, pose=Pose((2.7, 0, 0))),
        ObjectDescription(3, Sphere(0.3), name="ball"),
    ]
    shapes = encode_descriptions(0, "world", objects, snapshot=True)
    pipeline.on_shapes(shapes)
    write("ObjectDescriptionArray", shapes, 0)
    states = np.zeros(2, records.STATE)
    states["id"] = (1, 3)
    states["quaternion"][:, 3] = 1.0
    for k in range(steps):
        t, stamp = k * 0.02, k * 20_000_000
        states["position"][0], states["linear"][0] = (t, 0, 0), (1, 0, 0)
        away = t > 0.5
        states["position"][1], states["linear"][1] = (
            (0, 2.5 - min(t, 0.5) + max(t - 0.5, 0), 0),
            (0, 1 if away else -1, 0),
        )
        data = encode_states(stamp, "world", k + 1, states)
        outputs = pipeline.on_states(data)
        write("ObjectStateArray", data, stamp)
        write("ContactArray", outputs.contacts, stamp)
        write("PredictedCollisionArray", outputs.predictions, stamp)
        write("MonitorStatus", pipeline.status(step_duration=1e-3 + 1e-5 * (k % 7)), stamp)
    recorder.close()
    return path


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("report") / "run.mcap")


class Page(HTMLParser):
    """The tags of a page that are not void must be closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict]] = []
        self.text = ""

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in ("meta",):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def test_the_facts_are_what_happened(session: Path) -> None:
    history = read_history(Session(session))
    facts = gather(history)
    (collision,) = facts.collisions
    assert collision.pair == (1, 2)
    assert collision.begin == pytest.approx(1.5, abs=0.021)  # the front of its ball is at 0.7 m, the post's at 2.2 m
    assert facts.warned == [collision]
    assert facts.quickest == pytest.approx(1.5, abs=0.03)
    assert facts.surprises == facts.possible == []
    assert facts.false in ([], [(1, 3)])
    assert facts.risky[0] == (1, 2)
    times, distance = pair_distance(history, (1, 2))
    compound = history.objects[1].shapes
    for k in (0, 40, 90):
        here = contact(list(compound), Pose((times[k], 0, 0)), Sphere(0.5), Pose((2.7, 0, 0)))
        assert distance[k] == pytest.approx(here.signed_distance, abs=1e-12)


def test_the_page_stands_alone_and_is_safe(session: Path, tmp_path: Path) -> None:
    history = read_history(Session(session))
    files = write_report(history, tmp_path / "r.html", pictures=tmp_path / "png")
    text = (tmp_path / "r.html").read_text()
    page = Page()
    page.feed(text)
    assert page.open == []
    assert "1 collision" in page.text and "predicted, 1.5" in page.text
    assert text.count("<svg") == 5
    assert not any(tag == "script" for tag, _ in page.seen)
    for tag, attributes in page.seen:
        for name in ("src", "href", "xlink:href"):
            assert attributes.get(name, "#").startswith("#"), (tag, attributes)
    assert "url(http" not in text
    assert [f.name for f in files[1:]] == ["timeline.png", "predicted.png", "distances.png", "events.png", "steps.png"]
    assert all(f.read_bytes().startswith(b"\x89PNG") for f in files[1:])
    write_report(history, tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text() == text
    with pytest.raises(SessionError, match="one that exists"):
        write_report(history, tmp_path / "r.html")


def test_what_is_missing_is_said_first(tmp_path: Path) -> None:
    data = record(tmp_path / "cut.mcap", steps=30).read_bytes()
    data_end = data.rindex(b"\x0f\x04\0\0\0\0\0\0\0")
    (tmp_path / "cut.mcap").write_bytes(data[: data_end + 5])
    write_report(read_history(Session(tmp_path / "cut.mcap")), tmp_path / "cut.html")
    text = (tmp_path / "cut.html").read_text()
    assert "Not all is known: the recording was cut off" in text
    assert "No collision is known of" in text
    assert 'class="verdict unknown"' in text


def test_the_command(session: Path, tmp_path: Path) -> None:
    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [PROGRAM, "report", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=tmp_path)

    answer = run(session, "--replay", "fast")
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout == "run.html\n"
    assert "today's answers to the recorded inputs" in (tmp_path / "run.html").read_text()
    again = run(session)
    assert again.returncode == 1
    assert "--force" in again.stderr
    assert run(session, "--force").returncode == 0
    (tmp_path / "empty.mcap").write_bytes(b"")
    broken = run(tmp_path / "empty.mcap")
    assert broken.returncode == 1
    assert broken.stderr.count("\n") == 1
    assert run(session, "-o", "nowhere/r.html").returncode == 1
