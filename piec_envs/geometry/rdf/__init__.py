"""The distance field of the Panda in space: Bernstein polynomials of its bodies (Li et al.
2024).
"""

from piec_envs.geometry.rdf.field import RobotDistanceField, panda_distance_field, panda_shapes

__all__ = ["RobotDistanceField", "panda_distance_field", "panda_shapes"]
