""".venv/bin/python examples/tracked_objects.py

A perception stack publishes autoware TrackedObjects in the frame of a driving car. The monitor reads tf, so each track
gets its speed over ground. A pedestrian crosses before the car. Needs `make interfaces` once.
"""

from __future__ import annotations

import uuid
from pathlib import Path

import numpy as np
from autoware_perception_msgs.msg import ObjectClassification, Shape, TrackedObject, TrackedObjects
from beside_monitor import listen, monitored, print_predictions, wait_for_subscribers
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

SOURCES = Path(__file__).with_suffix(".yaml")
CAR, WALK = 5.0, 1.2  # m/s


def pedestrian(time: float) -> TrackedObject:
    """The track of a person, as seen from the car: pose in base_link, velocity relative to the car."""
    track = TrackedObject()
    track.object_id.uuid = np.frombuffer(uuid.UUID(int=7).bytes, np.uint8)
    track.existence_probability = 0.95
    track.classification = [ObjectClassification(label=ObjectClassification.PEDESTRIAN, probability=0.9)]
    pose = track.kinematics.pose_with_covariance.pose
    pose.position.x, pose.position.y = 14.0 - CAR * time, 3.0 - WALK * time
    track.kinematics.twist_with_covariance.twist.linear.x = -CAR
    track.kinematics.twist_with_covariance.twist.linear.y = -WALK
    track.kinematics.orientation_availability = 2
    track.shape.type = Shape.CYLINDER
    track.shape.dimensions.x = track.shape.dimensions.y = 0.6
    track.shape.dimensions.z = 1.8
    return track


def main() -> None:
    """Start the monitor, drive for 2 s, and print what it predicts."""
    with monitored(SOURCES, "perception") as node:
        tracks = node.create_publisher(TrackedObjects, "/perception/tracked_objects", 10)
        frames = node.create_publisher(TFMessage, "/tf", 10)
        print_predictions(node)
        wait_for_subscribers(node, tracks, frames)
        for tick in range(40):
            stamp = node.get_clock().now().to_msg()
            car = TransformStamped()
            car.header.stamp, car.header.frame_id, car.child_frame_id = stamp, "map", "base_link"
            car.transform.translation.x = CAR * tick * 0.05
            frames.publish(TFMessage(transforms=[car]))
            message = TrackedObjects()
            message.header.stamp, message.header.frame_id = stamp, "base_link"
            message.objects = [pedestrian(tick * 0.05)]
            tracks.publish(message)
            listen(node, 0.05)


if __name__ == "__main__":
    main()
