"""The distance field of the Panda: Bernstein polynomials of its bodies (Li et al. 2024), batched.

    d(p, q) = min over bodies b of f_b(T_b(q)^-1 p)

with f_b fitted once to the exact distance of the body's convex hull (`piec_envs.geometry.rdf.fit`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache

import numpy as np

from piec_envs.cache import cache_folder
from piec_envs.errors import DistanceFieldError, InvalidParameterError, InvalidStateError, as_count
from piec_envs.geometry.rdf.file import load_shapes, save_shapes
from piec_envs.geometry.rdf.fit import fit_shape
from piec_envs.geometry.rdf.kernels import PackedRdf, answer_rdf
from piec_envs.geometry.rdf.shape import FittedShape, binomials
from piec_envs.parallel import run_rows
from piec_envs.world.robots.panda import BODIES, SHA_256, body_frames, mesh_of, mesh_vertices

DEGREE = 16
DEGREES = range(4, 25)
MOVING = BODIES[1:]  # the base does not move


def pack_rdf(shapes: Mapping[str, FittedShape], bodies: Sequence[str] = MOVING) -> PackedRdf:
    """The polynomials of some bodies as flat arrays for the kernels.

    Args:
        shapes: by name, all of one degree.
        bodies: rows of `BODIES`.

    Returns:
        The polynomials, those of bodies with one mesh once, and which of them each body has.

    Raises:
        UnknownNameError: if the Panda has no such body.
        InvalidParameterError: if there is none.
    """
    if not bodies:
        raise InvalidParameterError(f"at least one body is needed, of {', '.join(BODIES)}")
    names = list(dict.fromkeys(map(mesh_of, bodies)))
    fitted = [shapes[name] for name in names]
    boxes = {
        key: np.array([getattr(shape.box, key) for shape in fitted])
        for key in fitted[0].box._fields
    }
    return PackedRdf(
        weights=np.array([shape.weights for shape in fitted]),
        binomials=binomials(len(fitted[0].weights) - 1),
        **boxes,
        slack=np.array([shape.slack for shape in fitted]),
        shape=np.array([names.index(mesh_of(body)) for body in bodies]),
        body=np.array([BODIES.index(body) for body in bodies]),
        joints=np.array([min(BODIES.index(body), 7) for body in bodies]),
    )


class RobotDistanceField:
    """Signed distance of points in space to the Panda, and its gradients.

    Rows of a batch do not depend on each other, so row i equals the single query bit for bit, with
    any number of threads.

    Args:
        shapes: fitted shapes by name, all of one degree.
        bodies: which bodies of the arm count, rows of `BODIES`; the base is left out by default.
        threads: threads over the rows of a batch; None takes all cores.

    Raises:
        UnknownNameError: if the Panda has no such body.
    """

    def __init__(
        self,
        shapes: Mapping[str, FittedShape],
        bodies: Sequence[str] = MOVING,
        threads: int | None = None,
    ):
        self.bodies = tuple(bodies)
        self.threads = threads
        self.packed = pack_rdf(shapes, self.bodies)

    @property
    def degree(self) -> int:
        """Degree n of the polynomials along each axis."""
        return self.packed.weights.shape[1] - 1

    def distance(self, points: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Signed distance of points to the arm.

        Args:
            points: shape (B, k, 3) or (k, 3), m.
            q: all seven joints, shape (B, 7) or (7,), rad.

        Returns:
            d, shape (B, k) or (k,), m; negative inside.

        Raises:
            InvalidStateError: if the shapes do not fit or a number is not finite.
        """
        return self._ask(points, q, 0)[0]

    def gradients(
        self, points: np.ndarray, q: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Signed distance and its gradients in the points and the joints.

        Args:
            points: shape (B, k, 3) or (k, 3), m.
            q: all seven joints, shape (B, 7) or (7,), rad.

        Returns:
            (d, dd_dp, dd_dq): m; shape (B, k, 3), without unit; shape (B, k, 7), m/rad. Without B
            for a single row.

        Raises:
            InvalidStateError: if the shapes do not fit or a number is not finite.
        """
        return self._ask(points, q, 1)

    def _ask(self, points, q, level):
        try:
            points = np.ascontiguousarray(points, dtype=float)
            q = np.ascontiguousarray(q, dtype=float)
        except (TypeError, ValueError) as error:
            raise InvalidStateError(f"points and q must be numbers: {error}") from error
        single = q.ndim == 1
        if single:
            points = points[None]
            q = q[None]
        if (
            points.ndim != 3
            or points.shape[2] != 3
            or q.ndim != 2
            or q.shape[1] != 7
            or len(points) != len(q)
        ):
            raise InvalidStateError(
                f"points must be (B, k, 3) and q (B, 7), or (k, 3) and (7,); "
                f"got {points.shape[single:]} and {q.shape[single:]}"
            )
        if not (np.isfinite(points).all() and np.isfinite(q).all()):
            raise InvalidStateError("points and q must be finite")
        rows, k = points.shape[:2]
        out = np.empty((rows, k)), np.empty((rows, k, 3 * level)), np.empty((rows, k, 7 * level))
        run_rows(answer_rdf, rows, self.threads, self.packed, level, body_frames(q), points, out)
        return tuple(array[0] for array in out) if single else out


@lru_cache(maxsize=4)
def panda_shapes(degree: int = DEGREE, threads: int | None = None) -> Mapping[str, FittedShape]:
    """The fitted shapes of the Panda, from the cache folder or fitted now and kept there if it can
    be written.

    Args:
        degree: of the polynomials.
        threads: of the fit; None takes all cores.

    Returns:
        The shape of each mesh by its name, to be treated as read-only.

    Raises:
        InvalidParameterError: if the degree is not one of `DEGREES`.
        MissingDependencyError: if they must be fitted and the package that brings the meshes is not
            installed.
        MeshError: if they must be fitted and a mesh is not the expected one.
    """
    degree = as_count("degree", degree)
    if degree not in DEGREES:
        raise InvalidParameterError(
            f"degree must be from {DEGREES[0]} to {DEGREES[-1]}, got {degree}"
        )
    folder = cache_folder()
    path = folder / f"panda-rdf-{degree}.npz" if folder else None
    if path:
        with suppress(DistanceFieldError):
            return load_shapes(path, degree)
    bodies = {mesh_of(body): body for body in BODIES}
    shapes = {name: fit_shape(mesh_vertices(bodies[name]), degree, threads) for name in SHA_256}
    if path:
        with suppress(OSError):
            save_shapes(path, shapes)
    return shapes


def panda_distance_field(
    degree: int = DEGREE, bodies: Sequence[str] = MOVING, threads: int | None = None
) -> RobotDistanceField:
    """The distance field of the Panda; its polynomials are fitted at first use, which takes
    seconds.

    Args:
        degree: of the polynomials.
        bodies: which bodies of the arm count.
        threads: threads over the rows of a batch; None takes all cores.

    Returns:
        The field, signed distances of points in space to the arm.

    Raises:
        InvalidParameterError: if the degree is out of range.
        UnknownNameError: if the Panda has no such body.
        MissingDependencyError: if the package that brings the meshes is not installed.
    """
    return RobotDistanceField(panda_shapes(degree, threads), bodies, threads)
