"""`python -m collision_monitor`: the same as `collision-monitor`."""

import sys

from collision_monitor.cli.main import main

sys.exit(main())
