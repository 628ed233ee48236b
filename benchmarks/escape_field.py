"""Time per escape field on one core: second-order marching and sweeping against scikit-fmm.

Our times include the robot's kinematics, the slowness map and one query; scikit-fmm's only its
`travel_time` of order 2, masked to the same disc. Run: python benchmarks/escape_field.py
"""

from __future__ import annotations

import time

import numpy as np

from piec_envs import GridField, draw_configurations, get_robot

ROBOT = "planar_arm"
RESOLUTIONS = (64, 100, 200)
CONFIGURATIONS = 60  # half uniform, half curled
REPEATS = 5
RING = 2.5  # cells outside the circle that scikit-fmm is given


def configurations(rows: int = CONFIGURATIONS, seed: int = 0) -> np.ndarray:
    """Half uniform, half curled, shape (rows, n)."""
    rng = np.random.default_rng(seed)
    return np.concatenate(
        [draw_configurations(ROBOT, kind, rows // 2, rng) for kind in ("uniform", "curled")]
    )


def _milliseconds(work, rows: int) -> float:
    """Least CPU time of `work` over the repeats, per row, ms."""
    best = np.inf
    for _ in range(REPEATS):
        start = time.thread_time()
        work()
        best = min(best, time.thread_time() - start)
    return 1e3 * best / rows


def scikit_inputs(field: GridField, q_r: np.ndarray):
    """Level set, speed and cell size that give scikit-fmm the same problem as `field`."""
    drawn = field.solve(q_r)
    h = float(drawn.x[1] - drawn.x[0])
    inside = get_robot(ROBOT).workspace_radius - np.hypot(drawn.x[None], drawn.y[:, None])  # (N, N)
    return np.ma.MaskedArray(inside, inside < -RING * h), drawn.speed, h


def run() -> list[dict]:
    """Measure every resolution.

    Returns:
        One row per resolution: ms per field of each solver and the ratios to scikit-fmm's (None if
        it is not installed).
    """
    try:
        import skfmm
    except ImportError:
        skfmm = None
    q = configurations()
    points = np.zeros((len(q), 1, 2))
    rows = []
    for resolution in RESOLUTIONS:
        row = {"resolution": resolution}
        for method in ("marching", "sweeping"):
            field = GridField(ROBOT, resolution, method, threads=1)
            field.query(points[:1], q[:1])  # compile
            row[f"{method}_ms"] = _milliseconds(lambda field=field: field.query(points, q), len(q))
        if skfmm is not None:
            inputs = [scikit_inputs(field, configuration) for configuration in q]
            work = [lambda i=i: skfmm.travel_time(i[0], i[1], dx=i[2], order=2) for i in inputs]
            row["scikit_ms"] = _milliseconds(lambda work=work: [solve() for solve in work], len(q))
            for method in ("marching", "sweeping"):
                row[f"{method}_speedup"] = row["scikit_ms"] / row[f"{method}_ms"]
        rows.append(row)
    return rows


def main() -> None:
    """Print the table."""
    rows = run()
    print("  ".join(f"{key:>17}" for key in rows[0]))
    for row in rows:
        print(
            "  ".join(
                f"{value:>17.3f}" if isinstance(value, float) else f"{value:>17}"
                for value in row.values()
            )
        )


if __name__ == "__main__":
    main()
