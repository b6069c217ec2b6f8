"""Tests of the files that commands write: no input is overwritten, no other file without --force, all checked first."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from collision_monitor.cli.main import main
from collision_monitor.errors import SessionError
from collision_monitor.session.output_file import check_output

GOLDEN = Path(__file__).parents[2] / "golden" / "balanced.mcap"
RULES = Path(__file__).parents[3] / "config" / "rules.yaml"
Run = Callable[..., tuple[int, str]]

COMMANDS = {
    "check": "check {session} --expect e.yaml --junit {out}",
    "tradeoff csv": "tradeoff {session} --profile own.yaml --csv {out}",
    "tradeoff png": "tradeoff {session} --profile own.yaml --png {out}",
    "tradeoff front": "tradeoff {session} --front --png {out}",
    "tune": "tune {session} --max-ttc-error 0.05 -o {out}",
    "tune png": "tune {session} --max-ttc-error 0.05 --png {out}",
    "extremes": "extremes --png {out}",
    "report": "report {session} -o {out}",
    "replay": "replay {session} --cut {out}",
    "import": "import {session} -o {out}",
    "salvage": "salvage {session} -o {out}",
    "demo": "demo --output new.mcap --capture {out}",
}
"""Every option of a command that names a file to write."""
READING = [name for name in COMMANDS if name not in ("extremes", "demo")]


class _Work(NamedTuple):
    folder: Path
    run: Run


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> _Work:
    """A folder with a session, as a file and as a recording's folder, and the files of settings beside it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.mcap").write_bytes(GOLDEN.read_bytes())
    (tmp_path / "rec").mkdir()
    (tmp_path / "rec" / "rec_0.mcap").write_bytes(GOLDEN.read_bytes())
    (tmp_path / "e.yaml").write_text("expect: [{replay: identical}]")
    (tmp_path / "own.yaml").write_text("horizon: 1.0")

    def run(command: str, *options: str, session: str = "run.mcap", out: str = "") -> tuple[int, str]:
        code = main([*command.format(session=session, out=out).split(), *options])
        return code, capsys.readouterr().err

    return _Work(tmp_path, run)


def one_line(error: str) -> bool:
    return error.startswith("collision-monitor: error: ") and error.count("\n") == 1


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("name", COMMANDS)
def test_no_existing_file_is_overwritten_without_force(name: str, work: _Work) -> None:
    (work.folder / "there.svg").write_text("mine")
    before = contents(work.folder)
    code, error = work.run(COMMANDS[name], out="there.svg")
    assert code == 1 and one_line(error)
    assert "there.svg: expected a new file, got one that exists; choose another name or --force" in error
    assert contents(work.folder) == before


@pytest.mark.parametrize("name", READING)
@pytest.mark.parametrize("link", ["same", "symbolic link", "hard link"])
def test_the_session_that_is_read_is_never_overwritten(name: str, link: str, work: _Work) -> None:
    picture = work.folder / "link.svg"  # a picture must have this ending
    if link == "symbolic link":
        picture.symlink_to("run.mcap")
    elif link == "hard link":
        picture.hardlink_to(work.folder / "run.mcap")
    elif "--png" in COMMANDS[name]:
        pytest.skip("a picture cannot have the name of a session")
    code, error = work.run(COMMANDS[name], "--force", out="run.mcap" if link == "same" else "link.svg")
    assert code == 1 and one_line(error) and "expected another file than" in error
    assert (work.folder / "run.mcap").read_bytes() == GOLDEN.read_bytes()


@pytest.mark.parametrize("name", [name for name in READING if "--png" not in COMMANDS[name]])
def test_no_file_of_a_recording_that_is_read_is_overwritten(name: str, work: _Work) -> None:
    session = "rec/rec_0.mcap" if name in ("salvage", "import") else "rec"
    code, error = work.run(COMMANDS[name], "--force", session=session, out="rec/rec_0.mcap")
    assert code == 1 and one_line(error) and "expected another file than" in error
    assert (work.folder / "rec" / "rec_0.mcap").read_bytes() == GOLDEN.read_bytes()


@pytest.mark.parametrize(
    ("name", "options", "file"),
    [
        ("check", "", "e.yaml"),
        ("check", "--rules rules.yaml", "rules.yaml"),
        ("check", "--replay own.yaml", "own.yaml"),
        ("tradeoff csv", "", "own.yaml"),
        ("tracks", "--path clip_ped.csv", "clip_ped.csv"),
        ("tracks", "--path clip", "clip_ped.csv"),
        ("report", "--rules rules.yaml", "rules.yaml"),
        ("report", "--replay own.yaml", "own.yaml"),
        ("import", "--map map.yaml", "map.yaml"),
        ("import", "--rules rules.yaml", "rules.yaml"),
        ("import", "--profile own.yaml", "own.yaml"),
        ("demo", "--scene trajectory --path clip", "clip_ped.csv"),
    ],
)
def test_no_other_input_is_overwritten(name: str, options: str, file: str, work: _Work) -> None:
    (work.folder / "rules.yaml").write_text(RULES.read_text())
    (work.folder / "map.yaml").write_text("frame: map\nobjects: {a: {topic: /a, shape: {sphere: 1}}}")
    rows = [f"1,{frame},p,{0.1 * frame},0,3,0" for frame in range(4)]
    (work.folder / "clip_ped.csv").write_text("\n".join(["id,frame,label,x_est,y_est,vx_est,vy_est", *rows]))
    before = contents(work.folder)
    command = COMMANDS.get(name, "tradeoff --scene trajectory --csv {out}")
    code, error = work.run(command, *options.split(), "--force", out=file)
    assert code == 1 and one_line(error) and f"{file}: expected another file than" in error
    assert contents(work.folder) == before


@pytest.mark.parametrize("name", COMMANDS)
def test_a_missing_folder_is_found_before_the_work(name: str, work: _Work) -> None:
    before = contents(work.folder)
    code, error = work.run(COMMANDS[name], out="nowhere/a.svg")
    assert code == 1 and one_line(error)
    assert "nowhere/a.svg: expected a file that can be written, got no folder nowhere" in error
    assert contents(work.folder) == before


@pytest.mark.parametrize("name", [name for name in COMMANDS if "--png" in COMMANDS[name]])
@pytest.mark.parametrize("out", ["out.xyz", "x.yaml", "run.mcap", "picture", ".png"])
def test_the_ending_of_a_picture_is_checked_before_the_work(name: str, out: str, work: _Work) -> None:
    code, error = work.run(COMMANDS[name], "--force", out=out)
    assert code == 2 and one_line(error)
    assert f"--png: expected a name that ends in .png, .svg, .pdf, got {out}" in error


def test_two_options_cannot_name_one_file(work: _Work) -> None:
    for command in (
        "tradeoff run.mcap --csv a.svg --png ./a.svg",
        "tune run.mcap -o a.svg --png a.svg",
        "demo --output a.svg --capture a.svg",
    ):
        code, error = work.run(command)
        assert code == 2 and one_line(error) and "expected two files" in error


def test_what_cannot_be_written_is_named_correctly(work: _Work) -> None:
    code, error = work.run("check run.mcap --expect e.yaml --junit /dev/full")
    assert (code, error) == (
        1, "collision-monitor: error: /dev/full: expected a file that can be written, got: No space left on device\n"
    )  # fmt: skip
    code, error = work.run("tradeoff run.mcap --profile fast --csv /dev/full")
    assert (code, error) == (
        1, "collision-monitor: error: /dev/full: expected a file that can be written, got: No space left on device\n"
    )  # fmt: skip


def test_with_force_a_command_writes_its_file_again(work: _Work) -> None:
    command = "check run.mcap --expect e.yaml --junit results.xml"
    assert work.run(command)[0] == 0
    assert work.run(command)[0] == 1
    (work.folder / "results.xml").write_text("old")
    assert work.run(command, "--force")[0] == 0
    assert (work.folder / "results.xml").read_text().startswith("<?xml")


def test_a_device_is_not_replaced_by_a_salvaged_file(work: _Work) -> None:
    os.mkfifo(work.folder / "pipe")
    code, error = work.run("salvage run.mcap -o pipe --force")
    assert code == 1 and one_line(error) and "got a named pipe" in error and (work.folder / "pipe").is_fifo()


def test_a_recording_is_not_imported_into_its_own_folder(work: _Work) -> None:
    code, error = work.run("import rec/rec_0.mcap -o rec --force")
    assert code == 1 and one_line(error) and "expected another folder than" in error
    assert (work.folder / "rec" / "rec_0.mcap").read_bytes() == GOLDEN.read_bytes()


def test_a_result_in_the_folder_of_a_recording_is_no_input(tmp_path: Path) -> None:
    (tmp_path / "page.html").touch()
    check_output(tmp_path / "page.html", overwrite=True, inputs=[tmp_path])


def test_a_device_needs_no_force() -> None:
    check_output(Path("/dev/null"), overwrite=False)


def test_a_name_that_no_file_can_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match="expected a file that can be written, got: File name too long"):
        check_output(tmp_path / ("x" * 300), overwrite=False)


def test_a_link_into_a_missing_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "nowhere" / "a")
    with pytest.raises(SessionError, match=r"got no folder .*nowhere"):
        check_output(tmp_path / "link", overwrite=False)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(SessionError, match="no permission"):
        check_output(tmp_path / "a", overwrite=False)
