"""The world as data: shapes, robots, objects, and the scene packed for the kernels."""
