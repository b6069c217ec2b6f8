"""Lay both ROS packages side by side, as a release repository and a workspace want them.

    python scripts/release_tree.py [FOLDER]         default: build/release

bloom's and colcon's crawlers stop at the first package.xml, so they do not see the messages inside of the package.
Files that git does not know are left out.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from catkin_pkg.packages import find_packages

ROOT = Path(__file__).resolve().parents[1]
INNER = "collision_monitor_msgs"


def main() -> int:
    """Make the tree anew and print the packages that catkin_pkg finds in it. Return 1 if they are not the two."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "release"
    if target.exists() and not (target / INNER / "package.xml").is_file() and any(target.iterdir()):
        print(f"{target}: expected a new folder or an older tree, got a folder with other files", file=sys.stderr)
        return 2
    shutil.rmtree(target, ignore_errors=True)
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, listed.split("\0")):
        place = target / name if name.startswith(f"{INNER}/") else target / "collision_monitor" / name
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, place, follow_symlinks=False)
    shutil.copy2(ROOT / "LICENSE", target / INNER)
    found = find_packages(str(target))
    for path, package in sorted(found.items()):
        print(f"{package.name} {package.version} in {target / path}")
    return 0 if sorted(found) == ["collision_monitor", INNER] else 1


if __name__ == "__main__":
    sys.exit(main())
