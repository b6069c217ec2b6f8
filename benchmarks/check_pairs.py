"""Compare our pairs and depths with the peers' reference: `check_pairs.py PEERS.PY SCENE.npz OURS.npz`.

Prints one JSON line. Runs under the peers' Python, because the reference needs its libraries. The reference is float64
SAT for boxes, the closed form for spheres, and Coal for mixed shapes and hulls.
"""

import importlib.util
import json
import sys

import numpy as np

spec = importlib.util.spec_from_file_location("peers", sys.argv[1])
peers = importlib.util.module_from_spec(spec)
spec.loader.exec_module(peers)
scene = peers.load_scene(sys.argv[2])
with np.load(sys.argv[3]) as ours:
    pairs, depth = ours["pairs"].astype(np.int64), ours["depth"]
keys, expected, name = peers.reference(scene, peers.CHECK)
if keys is None:
    print(json.dumps({"reference": None}))
    sys.exit()
mine = peers.key_of(pairs, scene["n"])
order = np.argsort(keys)
common, at_reference, at_ours = np.intersect1d(keys[order], mine, return_indices=True)
difference = np.abs(expected[order][at_reference] - depth[at_ours])
missing = len(keys) - len(common)
extra = len(mine) - len(common)
worst = float(difference.max()) if len(common) else 0.0
print(json.dumps({"reference": name, "missing": missing, "extra": extra, "worst_depth_difference_m": worst}))
