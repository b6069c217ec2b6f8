"""The picture of the scene: what it keeps between two steps."""

import numpy as np

from collision_monitor import records
from collision_monitor.codec import encode_descriptions, encode_states
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.ros.monitor.markers import MarkerView
from collision_monitor.shapes.registry import Sphere


def test_states_of_unknown_objects_leave_nothing():
    pipeline = Pipeline()
    view = MarkerView(pipeline.catalogue, "world")
    view.update(pipeline.on_shapes(encode_descriptions(10**12, "world", [ObjectDescription(7, Sphere(1.0))])))
    for k in range(3):
        states = np.zeros(100, records.STATE)
        states["id"], states["quaternion"][:, 3] = np.arange(1000 * k, 1000 * k + 100), 1.0
        states["id"][50] = 7
        outputs = pipeline.on_states(encode_states(10**12 + k * 10_000_000, "world", k + 1, states))
        assert outputs is not None
        assert len(view.draw(states, outputs.result)) > 1000
        assert view._poses.keys() == {7}
