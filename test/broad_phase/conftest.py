"""Makes the solids of the geometry tests importable."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "geometry"))
