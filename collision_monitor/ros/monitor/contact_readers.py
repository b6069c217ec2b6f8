"""Which details of contacts the node computes: those that a subscriber, the recording or a rule reads."""

from __future__ import annotations

from rclpy.publisher import Publisher

from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.ros.monitor.node_recording import NodeRecording
from collision_monitor.settings.profile import Profile


class ContactReaders:
    """Whether anything reads the witness points, features and patches of contacts. publishers: of what shows them."""

    def __init__(self, publishers: tuple[Publisher, ...], recording: NodeRecording, pipeline: Pipeline) -> None:
        self._publishers, self._recording, self._pipeline = publishers, recording, pipeline
        self.found = True
        """Whether there was a reader at the last look."""

    def look(self) -> bool:
        """Look for readers. Return whether the first one has come, or the last one has gone."""
        before, self.found = self.found, self.are_there
        return self.found != before

    @property
    def are_there(self) -> bool:
        """Whether there is a reader now."""
        if self._recording.is_on or self._pipeline.rules.rules:
            return True
        return any(each.get_subscription_count() for each in self._publishers)

    def used(self, profile: Profile) -> Profile:
        """Return what to use of a profile: without the details of contacts if there was no reader."""
        return profile if self.found else profile.replace(contact_details=False, contact_points=1)
