"""The table of objects: shapes, key points for the escape time, and mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piec_envs.errors import InvalidShapeError, check_name
from piec_envs.world.shapes import RoundedPolygon, box, disc, regular_polygon

# A key point nearer to the object's surface than this would enter the wall of the escape field
# (d0 = 0.03 m) when the object touches the arm, and pressing would pay as if it were enclosing.
MIN_KEY_POINT_DEPTH = 0.035  # m


@dataclass(frozen=True, eq=False)
class Loose:
    """A free body that comes with an object and is not fixed to it.

    Args:
        shapes: its geometry in its own frame.
        pose: x, y, angle at the start of an episode, in the object's frame, m and rad.
        mass: kg.
        height: of the upright prism that it is in space, m.
    """

    shapes: tuple[RoundedPolygon, ...]
    pose: tuple[float, float, float]
    mass: float
    height: float


@dataclass(frozen=True, eq=False)
class Object:
    """A rigid object in the plane.

    Args:
        name: its key in the table of objects.
        shapes: its geometry in its own frame.
        key_points: centres of inscribed discs, where the escape time is asked, shape (k, 2), m.
        mass: kg.
        height: of the upright prism that it is in space, m.
        loose: free bodies beside it, which move under MuJoCo alone. Distances, escape times and
            static caging know the object without them.

    Raises:
        InvalidShapeError: if a key point lies less than 0.035 m inside the surface.
    """

    name: str
    shapes: tuple[RoundedPolygon, ...]
    key_points: np.ndarray
    mass: float = 0.5
    height: float = 0.1
    loose: tuple[Loose, ...] = ()

    def __post_init__(self):
        for point in self.key_points:
            depth = max(depth_inside(shape, point) for shape in self.shapes)
            if depth < MIN_KEY_POINT_DEPTH:
                raise InvalidShapeError(
                    f"key point {point.tolist()} of {self.name!r} lies {depth:.3f} m inside the "
                    f"surface; "
                    f"at least {MIN_KEY_POINT_DEPTH} m is needed"
                )

    @property
    def bounding_radius(self) -> float:
        """Radius of the circle around the object's origin that contains it, m."""
        return max(float(np.linalg.norm(s.vertices, axis=1).max()) + s.radius for s in self.shapes)

    @property
    def gyration(self) -> float:
        """Radius of gyration about the origin of an even solid of these shapes, which do not
        overlap, m.
        """
        moments = [shape.polar_moment for shape in self.shapes]
        return float(np.sqrt(sum(moments) / sum(shape.area for shape in self.shapes)))


def depth_inside(shape: RoundedPolygon, point: np.ndarray) -> float:
    """Radius of the largest disc around a point inside one shape, a lower bound for capsules.

    Args:
        shape: the shape.
        point: the disc's centre in the frame of the shape, shape (2,), m.

    Returns:
        The radius, m; negative outside.
    """
    if len(shape.vertices) < 3:
        return shape.radius - float(np.linalg.norm(shape.vertices - point, axis=1).min())
    edges = np.roll(shape.vertices, -1, axis=0) - shape.vertices
    offsets = point - shape.vertices
    left = edges[:, 0] * offsets[:, 1] - edges[:, 1] * offsets[:, 0]
    return float((left / np.linalg.norm(edges, axis=1)).min()) + shape.radius


def _single(name: str, shape: RoundedPolygon, height: float = 0.1) -> Object:
    return Object(name, (shape,), key_points=np.zeros((1, 2)), height=height)


def _discs(name: str, centres: np.ndarray, radius: float, height: float = 0.1) -> Object:
    return Object(
        name, tuple(disc(radius, centre) for centre in centres), key_points=centres, height=height
    )


def _grid(x: tuple[float, ...], y: tuple[float, ...]) -> np.ndarray:
    """Points (a, b) for each a of x and b of y, shape (k, 2), m."""
    return np.array([(a, b) for b in y for a in x])


_ROLLS = _grid((-0.1, 0.0, 0.1), (-0.05, 0.05))  # (6, 2) of a paper pack
_ROLL_RADIUS = 0.05  # m
_PACK_HEIGHT = 0.22  # m
# Where the loose roll beside the box stands, 1 mm from it: near the first contacts of a Franka that
# begins to pull the box towards its base (inside of the elbow, fingertips), and twice ahead of the
# box on its way.
_PLACEMENTS = ((0.05, 0.161), (-0.08, -0.161), (-0.206, 0.06), (-0.206, -0.06))  # m


def _a4_box(name: str, *placements: tuple[float, float]) -> Object:
    """The box that a paper pack is taken for, with a loose roll at each placement (m) in
    its frame.
    """
    rolls = [
        Loose((disc(_ROLL_RADIUS),), (*at, 0.0), mass=0.1, height=_PACK_HEIGHT) for at in placements
    ]
    return Object(
        name, (box(0.31, 0.22),), _ROLLS, mass=0.6, height=_PACK_HEIGHT, loose=tuple(rolls)
    )


_TRIANGLE = np.array([(np.cos(a), np.sin(a)) for a in np.pi / 2 + 2 * np.pi / 3 * np.arange(3)])

# Everyday objects are as tall as they are; the others could be of any height. A box is held by its
# centre and by discs in its corners, of the radius of the rolls in a paper pack.
# A paper pack is six rolls; wrapped it is their rounded outline, and the sharp box is larger still.
# The three have the same key points, so that they are held alike whatever they are.
# The polygons contain the circle (same apothem): corner excess 6.2, 11.6 and 31.1 mm.
OBJECTS = {
    item.name: item
    for item in (
        _single("circle", disc(0.075)),
        _single("octagon", regular_polygon(8, 0.075)),
        _single("hexagon", regular_polygon(6, 0.075)),
        _single("square", regular_polygon(4, 0.075)),
        _discs("three_discs", 0.1 / np.sqrt(3) * _TRIANGLE, 0.05),
        _single("circle_119", disc(0.119)),
        _single("box_212", box(0.212, 0.212)),
        _single("water_jug", disc(0.08), height=0.3),
        Object(
            "box",
            (box(0.3, 0.2),),
            np.concatenate([np.zeros((1, 2)), _grid((-0.1, 0.1), (-0.05, 0.05))]),
            height=0.25,
        ),
        _discs("paper_pack", _ROLLS, _ROLL_RADIUS, height=_PACK_HEIGHT),
        Object(
            "paper_pack_wrapped",
            (RoundedPolygon(box(0.2, 0.1).vertices, _ROLL_RADIUS),),
            _ROLLS,
            height=_PACK_HEIGHT,
        ),
        _a4_box("a4_box"),
        *(_a4_box(f"a4_box_roll_{k}", at) for k, at in enumerate(_PLACEMENTS, start=1)),
    )
}


def get_object(name: str) -> Object:
    """The object of that name.

    Raises:
        UnknownNameError: if the table has no such row.
    """
    check_name("object", name, OBJECTS)
    return OBJECTS[name]
