"""Solids of cells of a regular lattice, as closed surfaces of merged faces."""
