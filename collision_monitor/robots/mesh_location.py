"""Files that a URDF or a sources file names: paths, `file://` and `package://` addresses."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final
from urllib.parse import unquote

from collision_monitor.errors import InputError

_PACKAGE_SCHEMES: Final = ("package://", "model://")
_SHOWN: Final = 6


class FileLocator:
    """Finds files. folder: of the URDF, for relative paths. packages: folders of packages by name, used first.

    Other packages are searched in the installed ones (AMENT_PREFIX_PATH), in ROS_PACKAGE_PATH, and in the folders
    above the URDF.
    """

    def __init__(self, folder: Path, packages: Mapping[str, Path] | None = None) -> None:
        self._folder = folder
        self._packages = dict(packages or {})

    def find(self, address: str) -> Path:
        """Return the file of an address. Raises InputError with the folders that were searched."""
        for scheme in _PACKAGE_SCHEMES:
            if address.startswith(scheme):
                name, _, rest = address.removeprefix(scheme).partition("/")
                return self._in_package(name, rest, address)
        scheme, separator, rest = address.partition("://")
        if separator and scheme != "file":
            raise InputError(f"expected a path, file:// or package://, got {address!r:.200}")
        path = Path(unquote(rest)) if separator else self._folder / address
        if not _is_file(path):
            raise InputError(f"expected the file {path!s:.300}, {_why_not(path)}")
        return path

    def _in_package(self, name: str, rest: str, address: str) -> Path:
        folders = [self._packages[name]] if name in self._packages else self._candidates(name)
        for folder in folders:
            if _is_file(folder / rest):
                return folder / rest
        searched = ", ".join(map(str, folders[:_SHOWN])) or "no folder"
        raise InputError(
            f"expected the file {address!r:.200} in the package {name!r:.80}, got none (searched: {searched}); "
            f"source the workspace that has it, or give its folder under `packages`"
        )

    def _candidates(self, name: str) -> list[Path]:
        found = [Path(prefix) / "share" / name for prefix in _paths("AMENT_PREFIX_PATH")]
        for root in _paths("ROS_PACKAGE_PATH"):
            found += [Path(root) / name, Path(root)] if Path(root).name == name else [Path(root) / name]
        for folder in (self._folder, *self._folder.resolve().parents):
            found += [folder] if folder.name == name else [folder / name]
        return [folder for folder in found if _is_folder(folder)]


def _paths(variable: str) -> list[str]:
    return [path for path in os.environ.get(variable, "").split(os.pathsep) if path]


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a folder that may not be read, a name that is too long, a path with a NUL
        return False


def _why_not(path: Path) -> str:
    try:
        path.stat()
    except FileNotFoundError:
        return "got none there"
    except (OSError, ValueError) as error:
        return f"it cannot be read: {getattr(error, 'strerror', None) or error!s:.100}"
    return "got something else there"
