"""Tests of files that serve as profiles."""

from __future__ import annotations

from pathlib import Path

import pytest

from collision_monitor.errors import ProfileError
from collision_monitor.settings.profile import Profile

EXAMPLE = Path(__file__).parents[2] / "config" / "monitor.yaml"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "tuned.yaml"


def test_a_parameter_file_is_a_profile(path: Path) -> None:
    path.write_text(
        "# Found by `collision-monitor tune`\n"
        "/**/object_monitor:\n  ros__parameters: {profile: fast, horizon: 3.0, frame_id: map, record: run.mcap,\n"
        "    use_sim_time: true, diagnostic_updater: {period: 2.0}, qos_overrides./tf.depth: 3}\n"
        "/other:\n  ros__parameters: {horizon: 9.0}\n"
    )
    assert Profile.named(str(path)) == Profile.named("fast").replace(name="tuned", horizon=3.0)


def test_the_example_is_the_default() -> None:
    assert Profile.named(str(EXAMPLE)) == Profile(name="monitor")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("/**:\n  ros__parameters: {horizn: 3.0}", "got 'horizn'"),
        ("/**:\n  ros__parameters: {profile: hasty}", "tuned.yaml, profile: expected one of balanced, exact, fast"),
        ("/other:\n  ros__parameters: {horizon: 3.0}", "parameters under /\\*\\*/object_monitor, got those of /other"),
        ("/**:\n  parameters: {horizon: 3.0}", "expected settings among"),
    ],
)
def test_parameter_files_that_are_refused(path: Path, text: str, words: str) -> None:
    path.write_text(text)
    with pytest.raises(ProfileError, match=words):
        Profile.named(str(path))
