"""Tests of the report page: it shows the facts, loads nothing else, is safe, and states first what is missing."""

from __future__ import annotations

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from played_session import NASTY, played, record_drive, record_scene, record_states

from collision_monitor.cli.main import main
from collision_monitor.errors import SessionError
from collision_monitor.report import write_report
from collision_monitor.session import Session
from collision_monitor.session.history.read_history import read_history
from collision_monitor.world.crossing import Crossing

PROGRAM = Path(sys.executable).with_name("collision-monitor")
PICTURES = ["timeline", "predicted", "distances", "events", "steps"]
VOID = ("meta", "br")


class Page(HTMLParser):
    """Tags and text of a page. Asserts that all tags are closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def report(session: Path, folder: Path, name: str = "r.html") -> str:
    (file,) = write_report(read_history(Session(session)), folder / name)
    return file.read_text(encoding="utf-8")


def test_the_page_says_what_happened(crossing: Path, tmp_path: Path) -> None:
    page = Page(report(crossing, tmp_path))
    encounters = [each for each in Crossing(None, None).expected if each.begin is not None]
    assert f"{len(encounters)} collisions" in page.text
    assert f"{len(encounters)} were predicted: at least 2.00 s ahead" in page.text
    assert "There may be more" not in page.text
    assert ("div", {"class": "verdict collisions"}) in page.tags
    for words in ("head_on_left – head_on_right", "determinism key", "digest at the last", "balanced: horizon 2"):
        assert words in page.text
    assert page.text.index("collisions") < page.text.index("Timeline") < page.text.index("Provenance")
    assert sum(tag == "svg" for tag, _ in page.tags) == 2 * len(PICTURES)  # broad and narrow


def test_the_page_stands_alone_and_names_are_harmless(drive: Path, tmp_path: Path) -> None:
    text = report(drive, tmp_path)
    page = Page(text)
    assert NASTY in page.text  # as text, and never escaped twice
    assert "<script" not in text
    assert not any(word in text for word in ("http:", "https:", "//", "@import", "javascript:"))
    ids = [attributes["id"] for _, attributes in page.tags if attributes.get("id")]
    assert len(ids) == len(set(ids))
    for tag, attributes in page.tags:
        assert tag not in ("script", "img", "link", "iframe", "object", "embed", "base", "form")
        assert not any(name.startswith("on") or name == "src" for name in attributes)
        if "href" in attributes:
            assert str(attributes["href"]).removeprefix("#") in ids
    assert report(drive, tmp_path, "again.html") == text


def test_nothing_is_called_clear_that_was_not_seen(tmp_path: Path) -> None:
    whole = record_drive(tmp_path / "whole.mcap", 0.4).read_bytes()
    assert 'class="verdict clear"' in report(tmp_path / "whole.mcap", tmp_path, "whole.html")
    (tmp_path / "cut.mcap").write_bytes(whole[: whole.rindex(b"\x0f\x04\0\0\0\0\0\0\0") + 5])
    text = report(tmp_path / "cut.mcap", tmp_path, "cut.html")
    assert 'class="verdict unknown"' in text
    assert "No known collision, but not everything is known" in text
    assert "the recording was cut off" in text


def test_a_session_without_answers_or_shapes_says_so(tmp_path: Path) -> None:
    record_drive(tmp_path / "inputs.mcap", 0.4, answers=False)
    text = report(tmp_path / "inputs.mcap", tmp_path, "inputs.html")
    assert "no step was answered; --replay" in text and 'class="verdict unknown"' in text
    assert main(["report", str(tmp_path / "inputs.mcap"), "-o", str(tmp_path / "now.html"), "--replay"]) == 0
    assert 'class="verdict clear"' in (tmp_path / "now.html").read_text()
    scene = Crossing(None, None)
    record_states(tmp_path / "bare.mcap", [], played(scene, 0.2))
    text = report(tmp_path / "bare.mcap", tmp_path, "bare.html")
    assert "the session describes no object" in text
    assert "unknown id" in text and 'class="verdict unknown"' in text


def test_a_gap_and_an_unseen_object_are_doubts(tmp_path: Path) -> None:
    scene = Crossing(None, None)
    states = [(t, rows[rows["id"] != 1]) for t, rows in played(scene, 2.4) if not 0.51 < t < 1.49]
    record_states(tmp_path / "gap.mcap", scene.descriptions, states)
    text = report(tmp_path / "gap.mcap", tmp_path)
    assert "no step from 0.50 s to 1.50 s" in text
    assert "no state of head_on_left was ever received" in text


def test_long_lists_say_what_is_left_out(tmp_path: Path) -> None:
    page = Page(report(record_scene(tmp_path / "many.mcap", "clutter", 1.0, objects=150), tmp_path))
    for words in ("more pairs left out", "more left out"):
        assert words in page.text
    assert len(page.text) < 100_000


def test_the_command_writes_pages_and_pictures(drive: Path, tmp_path: Path) -> None:
    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [PROGRAM, "report", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, cwd=tmp_path)

    answer = run(drive, "--replay", "fast", "--png", "png")
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.splitlines() == ["drive.html", *(f"png/{name}.png" for name in PICTURES)]
    assert answer.stderr == ""  # no progress bar without a terminal
    assert "today's answers to the recorded inputs" in (tmp_path / "drive.html").read_text()
    assert all((tmp_path / f"png/{name}.png").read_bytes().startswith(b"\x89PNG") for name in PICTURES)


def test_bad_input_is_one_line_and_nothing_is_overwritten(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "there.html").write_text("mine")
    (tmp_path / "png").mkdir()
    (tmp_path / "png" / "steps.png").write_text("mine")
    (tmp_path / "file").touch()
    for arguments, words in (
        ([tmp_path / "none.mcap"], "nothing there"),
        ([tmp_path / "empty.mcap"], "the file is empty"),
        ([drive, "-o", tmp_path / "there.html"], "--force"),
        ([drive, "-o", tmp_path / "new.html", "--png", tmp_path / "png"], "--force"),
        ([drive, "-o", tmp_path], "got a folder"),
        ([drive, "-o", drive, "--force"], "another file than"),
        ([drive, "-o", tmp_path / "file" / "r.html"], "can be written"),
        ([drive, "-o", tmp_path / "nowhere" / "r.html"], "no folder"),
        ([drive, "-o", tmp_path / "new.html", "--png", tmp_path / "nowhere" / "png"], "can be written"),
        ([drive, "-o", tmp_path / "new.html", "--png", tmp_path / "file"], "expected a folder"),
        ([drive, "-o", tmp_path / "new.html", "--replay", "hasty"], "expected one of"),
    ):
        assert main(["report", *map(str, arguments)]) == (2 if "hasty" in arguments else 1)
        error = capsys.readouterr().err
        assert error.count("\n") == 1 and words in error
    assert (tmp_path / "there.html").read_text() == (tmp_path / "png" / "steps.png").read_text() == "mine"
    assert not (tmp_path / "new.html").exists() and not (tmp_path / "nowhere").exists()
    assert main(["report", str(drive), "-o", str(tmp_path / "there.html"), "--force"]) == 0
    with pytest.raises(SessionError, match="one that exists"):
        write_report(read_history(Session(drive)), tmp_path / "there.html")
