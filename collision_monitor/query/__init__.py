"""Two shapes without a monitor: contact, overlap, features, time of impact."""
