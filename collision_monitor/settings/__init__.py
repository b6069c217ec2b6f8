"""The settings that trade speed for accuracy, and the profiles that set them."""
