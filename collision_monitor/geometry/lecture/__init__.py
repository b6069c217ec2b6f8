"""Textbook methods of the lectures that nothing hot imports; queries and tests reach them by name."""
