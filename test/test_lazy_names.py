"""Names that a package imports at their first use: each is there, whatever was renamed."""

from __future__ import annotations

from importlib import import_module

import pytest

PACKAGES = ("collision_monitor", "collision_monitor.session", "collision_monitor.sources")


@pytest.mark.parametrize("package", PACKAGES)
def test_each_name_that_is_imported_at_its_first_use_is_there(package: str) -> None:
    module = import_module(package)
    for name in module.__all__:
        assert getattr(module, name) is not None, name
