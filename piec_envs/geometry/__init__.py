"""Kinematics and distances of rounded convex polygons, as small compiled kernels."""
