"""What the monitor keeps between steps: the roster, the timeline, snapshots."""
