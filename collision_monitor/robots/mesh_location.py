"""Files that a URDF or a sources file names: paths, `file://` and `package://` addresses."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final
from urllib.parse import unquote

from collision_monitor.errors import InputError
from collision_monitor.settings.regular_file import FOLDER, found_instead

_PACKAGE_SCHEMES: Final = ("package://", "model://")
_SHOWN: Final = 6
_THIS_MACHINE: Final = ("", "localhost")  # RFC 8089
_NO_NAMES: Final = ("", os.curdir, os.pardir)


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
        host, slash, there = rest.partition("/")
        if separator and (host not in _THIS_MACHINE or not slash):
            raise InputError(f"expected file:///PATH, a file of this machine, got {address!r:.200}")
        path = Path(unquote(slash + there)) if separator else self._folder / address
        if found := found_instead(path):
            raise InputError(f"expected the file {str(path)!r:.200}, got {found}")
        return path

    def _in_package(self, name: str, rest: str, address: str) -> Path:
        """Return the file below the folder of a package. A link in it may lead elsewhere, as those of colcon do."""
        if name in _NO_NAMES or os.path.isabs(rest) or os.path.normpath(rest).split(os.sep)[0] == os.pardir:
            raise InputError(f"expected package://PACKAGE/PATH with a path in the package, got {address!r:.200}")
        folders = [self._packages[name]] if name in self._packages else self._candidates(name)
        found = [found_instead(folder / rest) for folder in folders]
        if "" in found:
            return folders[found.index("")] / rest
        there = zip(folders[:_SHOWN], found, strict=False)
        searched = ", ".join(f"{folder}: {what}" for folder, what in there) or "no folder"
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
        return [folder for folder in found if found_instead(folder) == FOLDER]


def _paths(variable: str) -> list[str]:
    return [path for path in os.environ.get(variable, "").split(os.pathsep) if path]
