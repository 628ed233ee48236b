"""How fast an escaping point may move near the robot, and the slowness map of a configuration.

Slowness is 1 / speed. In free space speed = u_bar max(alpha, floor) with
alpha = a_min + (1 - a_min) / (1 + E) and E = exp(-s (d - tau)), so that
1 / alpha = (1 + E) / (1 + a_min E): one division per node (paper, appendix "Speed field from
robot SDF"). Within d0 of the robot the speed is leak * u_bar; leak 0 is the paper's hard wall.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import NamedTuple

import numpy as np

from piec_envs.errors import InvalidParameterError
from piec_envs.kernels import batch_kernel, kernel


class PackedSpeed(NamedTuple):
    """The numbers of a `SpeedModel` for the compiled kernels."""

    u_bar: float  # m/s
    a_min: float  # share of u_bar
    tau: float  # m
    s: float  # 1/m
    d0: float  # m
    floor: float  # share of u_bar
    leak: float  # share of u_bar


@dataclass(frozen=True)
class SpeedModel:
    """Largest speed of an escaping point as a function of its signed distance d to the robot.

    Args:
        u_bar: speed in free space, m/s.
        a_min: share of u_bar that the sigmoid tends to inside the robot.
        tau: distance at the middle of the sigmoid, m.
        s: steepness of the sigmoid, 1/m.
        d0: thickness of the wall around the robot, m.
        floor: least share of u_bar outside the wall.
        leak: share of u_bar inside the wall, below 1; 0 closes it.

    Raises:
        InvalidParameterError: if a number is not finite or outside its range.
    """

    u_bar: float = 0.05
    a_min: float = 0.01
    tau: float = 0.05
    s: float = 40.0
    d0: float = 0.03
    floor: float = 0.001
    leak: float = 0.05

    def __post_init__(self):
        for name, low, high, end in (
            ("u_bar", 1e-12, np.inf, ")"),
            ("a_min", 1e-12, 1.0, "]"),
            ("tau", -np.inf, np.inf, ")"),
            ("s", 0.0, np.inf, ")"),
            ("d0", 0.0, np.inf, ")"),
            ("floor", 0.0, 1.0, "]"),
            ("leak", 0.0, 1.0, ")"),
        ):
            value = getattr(self, name)
            if not (np.isfinite(value) and (low <= value < high or (end == "]" and value == high))):
                raise InvalidParameterError(
                    f"{name} must be finite and in [{low}, {high}{end}, got {value}"
                )
            object.__setattr__(self, name, float(value))

    def speed(self, d):
        """Largest speed at signed distance d, the readable reference of the kernels.

        Args:
            d: signed distance to the robot, any shape, m.

        Returns:
            Speed in m/s, the shape of d.
        """
        d = np.asarray(d, dtype=float)
        sigmoid = 1 / (1 + np.exp(np.clip(-self.s * (d - self.tau), -700, 700)))
        alpha = self.a_min + (1 - self.a_min) * sigmoid
        return self.u_bar * np.where(d > self.d0, np.maximum(alpha, self.floor), self.leak)

    def packed(self) -> PackedSpeed:
        """The same numbers as a named tuple, for the kernels."""
        return PackedSpeed(*astuple(self))


@kernel
def decay(z):
    """exp(z) to a relative 1e-12 for |z| <= 20, by ten squarings of a Taylor series, so that loops
    vectorise.

    Beyond |z| = 40 it stays constant: there alpha equals one of its two limits to 1e-17.
    """
    z = z if z < 40.0 else 40.0
    z = z if z > -40.0 else -40.0
    w = z / 1024.0
    e = 1.0 + w * (
        1.0 + w / 2.0 * (1.0 + w / 3.0 * (1.0 + w / 4.0 * (1.0 + w / 5.0 * (1.0 + w / 6.0))))
    )
    for _ in range(10):
        e = e * e
    return e


@kernel
def slowness(speed, d):
    """1 / u at signed distance d, s/m (inf in the hard wall).

    Args:
        speed: a `PackedSpeed`.
        d: signed distance to the robot, m.

    Returns:
        The slowness, s/m.
    """
    e = decay(-speed.s * (d - speed.tau))
    inverse = (1.0 + e) / (1.0 + speed.a_min * e)  # 1 / alpha
    inverse = inverse if inverse * speed.floor < 1.0 else 1.0 / speed.floor
    wall = 1.0 / speed.leak if speed.leak > 0.0 else np.inf
    return (inverse if d > speed.d0 else wall) / speed.u_bar


@kernel
def slowness_slope(speed, d):
    """d(1/u)/dd away from the wall's edge, s/m^2 (0 inside the wall).

    Args:
        speed: a `PackedSpeed`.
        d: signed distance to the robot, m.

    Returns:
        The slope, s/m^2.
    """
    if d <= speed.d0:
        return 0.0
    e = decay(-speed.s * (d - speed.tau))
    bottom = 1.0 + speed.a_min * e
    if (1.0 + e) * speed.floor >= bottom:
        return 0.0
    return -speed.s * e * (1.0 - speed.a_min) / (bottom * bottom) / speed.u_bar


@kernel
def _lower_to_capsule(a, b, radius, x, y, distance):
    """Lower `distance` (M,) to that of the capsule from a to b at the points (x, y)."""
    a_x, a_y = a[0], a[1]
    e_x, e_y = b[0] - a_x, b[1] - a_y
    length2 = e_x * e_x + e_y * e_y
    scale = 1.0 / length2 if length2 > 0.0 else 0.0
    for k in range(x.shape[0]):
        d_x, d_y = x[k] - a_x, y[k] - a_y
        t = (d_x * e_x + d_y * e_y) * scale
        t = t if t > 0.0 else 0.0
        t = t if t < 1.0 else 1.0
        r_x, r_y = d_x - t * e_x, d_y - t * e_y
        d = np.sqrt(r_x * r_x + r_y * r_y) - radius
        distance[k] = d if d < distance[k] else distance[k]


@batch_kernel
def _lower_to_polygon(corners, radius, x, y, distance, square, depth):
    """Lower `distance` (M,) to that of a rounded polygon with `corners` (k, 2), k > 2, at
    (x, y).
    """
    square[:] = np.inf
    depth[:] = -np.inf
    for i in range(corners.shape[0]):
        j = i + 1 if i + 1 < corners.shape[0] else 0
        a_x, a_y = corners[i, 0], corners[i, 1]
        e_x, e_y = corners[j, 0] - a_x, corners[j, 1] - a_y
        length2 = e_x * e_x + e_y * e_y
        scale, unit = 1.0 / length2, 1.0 / np.sqrt(length2)
        for k in range(x.shape[0]):
            d_x, d_y = x[k] - a_x, y[k] - a_y
            t = (d_x * e_x + d_y * e_y) * scale
            t = t if t > 0.0 else 0.0
            t = t if t < 1.0 else 1.0
            r_x, r_y = d_x - t * e_x, d_y - t * e_y
            r = r_x * r_x + r_y * r_y
            plane = (d_x * e_y - d_y * e_x) * unit  # > 0 outside this edge
            square[k] = r if r < square[k] else square[k]
            depth[k] = plane if plane > depth[k] else depth[k]
    for k in range(x.shape[0]):
        d = (np.sqrt(square[k]) if depth[k] > 0.0 else depth[k]) - radius
        distance[k] = d if d < distance[k] else distance[k]


@batch_kernel
def distance_map(shapes, vertices, x, y, distance, work):
    """Signed distance to the robot at many points: `point_distance`, shape by shape, in loops that
    vectorise.

    Args:
        shapes: the robot's `PackedShapes`.
        vertices: world vertices from `place_shapes`, shape (V, 2), m.
        x, y: the points, shape (M,), m.
        distance: output, shape (M,), m.
        work: scratch, shape (2, M).
    """
    distance[:] = np.inf
    for i in range(shapes.radius.shape[0]):
        first, last = shapes.first[i], shapes.first[i + 1]
        if last - first < 3:
            _lower_to_capsule(vertices[first], vertices[last - 1], shapes.radius[i], x, y, distance)
        else:
            _lower_to_polygon(
                vertices[first:last], shapes.radius[i], x, y, distance, work[0], work[1]
            )


@kernel
def cost_map(speed, distance, h, out):
    """Slowness times cell size at every distance of an array.

    Args:
        speed: a `PackedSpeed`.
        distance: signed distances, shape (M,), m.
        h: cell size, m.
        out: output, shape (M,), s.
    """
    for k in range(distance.shape[0]):
        out[k] = slowness(speed, distance[k]) * h
