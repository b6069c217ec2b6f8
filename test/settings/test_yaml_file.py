"""Tests of the loader of YAML: what it takes for a number. test/attacks/test_hostile_yaml.py has its limits."""

from __future__ import annotations

from pathlib import Path

import pytest

from collision_monitor.settings.profile import Profile
from collision_monitor.settings.yaml_file import parse_yaml


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-4", 1e-4), ("-1e+18", -1e18), ("1E5", 1e5), ("+2e3", 2e3), ("1.5e3", 1.5e3), (".5e1", 5.0),
        ("1.e2", 100.0), ("1.0e-4", 1e-4), ("0x1e5", 0x1E5), ("10", 10), ("010", 8),
    ],
)  # fmt: skip
def test_numbers(text: str, value: float) -> None:
    found = parse_yaml(text, "numbers.yaml")
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize(
    "text", ["1e", "e5", "1e+", ".e5", "1.2.3e4", "v1e5", "1e5a", "2e5f-11", "1_e5", "1234e5678", "'1e5'", "08"]
)
def test_texts_that_look_like_numbers(text: str) -> None:
    assert parse_yaml(text, "texts.yaml") == text.strip("'")


def test_a_profile_with_exponents(tmp_path: Path) -> None:
    path = tmp_path / "fine.yaml"
    path.write_text("impact_tolerance: 1e-5\nbudget_ms: 1e+06\n")
    profile = Profile.named(str(path))
    assert (profile.impact_tolerance, profile.budget_ms) == (1e-5, 1e6)
