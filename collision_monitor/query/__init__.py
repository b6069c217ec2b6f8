"""Queries of two shapes without a monitor: contact, overlap, features and time of impact."""
