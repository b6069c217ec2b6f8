"""Subscribers: what is on the graph, and what a monitor publishes."""
