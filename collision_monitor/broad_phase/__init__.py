"""Which pairs can be near each other: grids, and brute force as their reference."""
