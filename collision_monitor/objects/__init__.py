"""Descriptions of objects, and the models that represent them."""
