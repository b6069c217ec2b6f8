"""The node that monitors: its subscriptions, answers, sources, settings and load."""
