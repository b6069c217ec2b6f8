"""The set-up's modules live beside the set-up, not in the package."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts" / "set_up"))
