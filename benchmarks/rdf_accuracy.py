"""Accuracy and speed of the robot distance field, and how it differs from the planar polygons.

Run: python benchmarks/rdf_accuracy.py
"""

from __future__ import annotations

import time
from tempfile import TemporaryDirectory

import numpy as np

from piec_envs import (
    GridField,
    RobotDistanceField,
    draw_configurations,
    draw_points,
    robot_distance,
)
from piec_envs.geometry.convex import convex_hull, hull_distances
from piec_envs.geometry.rdf.field import DEGREE, MOVING, mesh_of, pack_rdf
from piec_envs.geometry.rdf.file import save_shapes
from piec_envs.geometry.rdf.fit import SHELL, exact_distance, fit_shape
from piec_envs.world.robots.franka import PLANE, all_joints
from piec_envs.world.robots.panda import BODIES, LOWER, UPPER, body_frames, mesh_vertices

DEGREES = (8, 12, 16, 20, 24)
POINTS = 20_000
NAMES = {mesh_of(body): body for body in BODIES}


def fit_all(degree: int) -> dict:
    """The polynomials of all bodies, fitted now."""
    return {name: fit_shape(mesh_vertices(body), degree) for name, body in NAMES.items()}


def shell_points(body: str, rng: np.random.Generator) -> np.ndarray:
    """Points of space within 0.2 m of a body, then as many inside it, each evenly spread,
    (B, 3).
    """
    vertices = mesh_vertices(body)
    hull = convex_hull(vertices)
    low = vertices.min(axis=0)
    high = vertices.max(axis=0)
    around = rng.uniform(low - SHELL, high + SHELL, (2 * POINTS, 3))
    inside = rng.uniform(low, high, (2 * POINTS, 3))
    d = exact_distance(hull, around)
    return np.concatenate(
        [around[(d > 0) & (d <= SHELL)], inside[exact_distance(hull, inside) <= 0]]
    )


def accuracy(d: np.ndarray, slope: np.ndarray, true: np.ndarray) -> dict:
    """Errors of distances (B,) and gradients (B, 3), outside and inside apart."""
    row: dict[str, float] = {}
    norm = np.linalg.norm(slope, axis=-1)
    for side, rows in (("outside", (true > 0) & (true <= SHELL)), ("inside", true <= 0)):
        error = np.abs(d - true)[rows]
        row[f"{side} mean_mm"] = 1e3 * error.mean()
        row[f"{side} max_mm"] = 1e3 * error.max()
        row[f"{side} norm"] = np.median(norm[rows])
        row[f"{side} norm 1+-0.05_%"] = 100 * np.mean(np.abs(norm[rows] - 1) < 0.05)
    return row


def bodies(shapes: dict) -> list[dict]:
    """Every body by itself, in its frame."""
    table = []
    still = body_frames(np.zeros(7))
    for name, body in NAMES.items():
        points = shell_points(body, np.random.default_rng(0))
        pose = still[BODIES.index(body)]
        field = RobotDistanceField(shapes, (body,))
        d, slope, _ = field.gradients(points @ pose[:3, :3].T + pose[:3, 3], np.zeros(7))
        true = exact_distance(convex_hull(mesh_vertices(body)), points)
        table.append({"check": name} | accuracy(d, slope, true))
    return table


def true_distance(points: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Exact distance of points (k, 3) to the moving bodies in the posture q (7,), m."""
    frames = body_frames(q)
    best = np.full(len(points), np.inf)
    for body in MOVING:
        pose = frames[BODIES.index(body)]
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        best = np.minimum(best, exact_distance(convex_hull(mesh_vertices(body)), local))
    return best


def whole_arm(shapes: dict, postures: int = 10) -> dict:
    """The whole arm in random postures, at points around random bodies and in them."""
    rng = np.random.default_rng(1)
    field = RobotDistanceField(shapes)
    found = []
    for q in rng.uniform(LOWER, UPPER, (postures, 7)):
        frames = body_frames(q)
        local = {body: shell_points(body, rng)[:: 5 * postures] for body in MOVING}
        poses = {body: frames[BODIES.index(body)] for body in MOVING}
        points = np.concatenate([local[b] @ poses[b][:3, :3].T + poses[b][:3, 3] for b in MOVING])
        found.append((*field.gradients(points, q)[:2], true_distance(points, q)))
    return {"check": "whole arm"} | accuracy(
        *(np.concatenate(arrays) for arrays in zip(*found, strict=True))
    )


def seconds(call, *args, repeats: int = 3) -> float:
    """Least time of a call, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call(*args)
        times.append(time.perf_counter() - start)
    return min(times)


def speed(shapes: dict, degree: int) -> dict:
    """Microseconds per point on one core, for one link and for the whole arm; size of the file."""
    rng = np.random.default_rng(2)
    q = rng.uniform(LOWER, UPPER, (20, 7))
    points = rng.uniform([-0.7, -0.7, -0.2], [0.7, 0.7, 1.2], (20, 500, 3))
    row: dict = {"check": f"degree {degree}, time"}
    for name, chosen in (("one link", ("link5",)), ("whole arm", MOVING)):
        field = RobotDistanceField(shapes, chosen, threads=1)
        for what, call in (("value", field.distance), ("value+gradients", field.gradients)):
            row[f"{name} {what}_us"] = 1e6 * seconds(call, points, q) / 10_000
    row["arm per link_us"] = row["whole arm value+gradients_us"] / len(MOVING)
    with TemporaryDirectory() as folder:
        size = save_shapes(f"{folder}/field.npz", shapes).stat().st_size
    return row | {"arrays_MB": pack_rdf(shapes, BODIES).weights.nbytes / 1e6, "file_MB": size / 1e6}


def exact_speed() -> dict:
    """The exact distance to one body on one core, for comparison."""
    hull = convex_hull(mesh_vertices("link5"))
    points = np.random.default_rng(2).uniform(-0.7, 0.7, (10_000, 3))
    out = np.empty(len(points))
    hull_distances(0, 1, hull, points, out)
    return {
        "check": "exact, time",
        "one link value_us": 100 * seconds(hull_distances, 0, len(points), hull, points, out),
    }


def grid_speed() -> dict:
    """Milliseconds of one escape field of 200 x 200 nodes on one core, with either distance."""
    q = np.array([[0.3, -1.8, 1.4]])
    point = np.array([[[0.3, 0.1]]])
    row: dict = {"check": "escape field, time"}
    for name in ("rdf", "polygons"):
        field = GridField("franka", 200, "marching", threads=1, distance=name)
        row |= {f"{name}_ms": 1e3 * seconds(field.query, point, q)}
    return row


def degrees() -> list[dict]:
    """What each degree reaches: its worst body, and its speed."""
    table = []
    for degree in DEGREES:
        start = time.perf_counter()
        shapes = fit_all(degree)
        fit = time.perf_counter() - start
        rows = bodies(shapes)
        keys = [key for key in rows[0] if key != "check"]
        worst = {key: (max if "_mm" in key else min)(row[key] for row in rows) for key in keys}
        table += [
            {"check": f"degree {degree}, worst body"} | worst,
            speed(shapes, degree) | {"fit_s": fit},
        ]
    return table


def against_polygons(shapes: dict) -> list[dict]:
    """The field in the plane minus the distance to the planar robot, and T on either."""
    table = []
    field = RobotDistanceField(shapes)
    for kind in ("uniform", "curled"):
        rng = np.random.default_rng(3)
        q = draw_configurations("franka", kind, 50, rng)
        points = draw_points("franka", kind, q, 200, rng, clearance=-0.03)
        polygons = robot_distance("franka", points, q)
        space = np.concatenate([points, np.full((*points.shape[:2], 1), PLANE)], axis=-1)
        difference = 1e3 * (field.distance(space, all_joints(q)) - polygons)[polygons < SHELL]
        cuts = {f"p{p}_mm": np.percentile(difference, p) for p in (0, 1, 10, 50, 90, 99, 100)}
        share = {"below_-3mm_%": 100 * np.mean(difference < -3.0)}
        table.append({"check": f"in the plane minus polygons, {kind}"} | cuts | share)
        clear = draw_points("franka", kind, q, 50, rng)
        T = [
            GridField("franka", 200, "marching", distance=name).query(clear, q)
            for name in ("rdf", "polygons")
        ]
        ratio = T[0] / T[1]
        cuts = {f"p{p}": np.percentile(ratio, p) for p in (0, 1, 10, 50, 90, 99, 100)}
        table.append({"check": f"T (rdf) / T (polygons), {kind}"} | cuts)
    return table


def main() -> None:
    """Print one line per check."""
    shapes = fit_all(DEGREE)
    for row in [
        *bodies(shapes),
        whole_arm(shapes),
        *against_polygons(shapes),
        exact_speed(),
        grid_speed(),
        *degrees(),
    ]:
        numbers = (f"{key} {value:.4g}" for key, value in list(row.items())[1:])
        print(f"{row['check']:38}", "  ".join(numbers), flush=True)


if __name__ == "__main__":
    main()
