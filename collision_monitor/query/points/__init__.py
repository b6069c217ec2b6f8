"""Points, rays and bounding slabs against one shape."""
