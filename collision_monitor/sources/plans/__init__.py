"""Plans that other programs publish, as plans of the objects of a sources file."""
