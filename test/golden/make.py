"""Record the golden sessions anew. Do so only after an intended change of answers; state the reason in the commit.

python test/golden/make.py
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

HERE: Final = Path(__file__).parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parent / "helpers")]

from session_scene import record  # noqa: E402

from collision_monitor.pipeline.pipeline import Pipeline  # noqa: E402

STEPS: Final = 300
PROFILES: Final = ("balanced", "exact")


def main() -> None:
    """Record a session for each profile: 3 s of six bodies and a wall, with invalid inputs."""
    for name in PROFILES:
        path = HERE / f"{name}.mcap"
        path.unlink(missing_ok=True)
        pipeline = Pipeline(name)
        record(path, STEPS, pipeline=pipeline, pauses=(60, 180))
        print(f"{path.name}: {path.stat().st_size} bytes, digest {pipeline.monitor.digest:016x}")


if __name__ == "__main__":
    main()
