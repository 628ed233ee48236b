"""The square annulus: what the escape time says of a point mass in a cage (paper, section 3.4).

The mass moves at speed 1 outside the obstacle and at 0 (hard wall) or at `leak` (leaky wall)
inside. The annulus stands beside the disc's centre and askew: around the centre every free point
would have the straight way out, which the solver knows, and upright walls would lie along the grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.figures import ObstaclePanel, escape_times
from evaluation.jobs import Context, Work, run_recorded
from evaluation.studies.annulus import Annulus
from evaluation.tables import write_table
from piec_envs import ObstacleField, even_speed

DO = "evaluation.studies.eikonal_toy:solve_once"
SEED = 0  # of the random points
LONGER = 1e-9  # relative: a way longer than the straight one leads around a corner

NOTES = """\
Second-order marching; h is the cell size, m. T at the star, s, beside the exact value: infinite
behind a hard wall, and behind a leaky one the time of the fastest refracted path through it.
Enclosed: area of the grid's free nodes where T is infinite, m^2, beside the exact one, that of the
cavity or 0. The other columns are of random points: "misjudged" counts those outside the wall that
are taken for enclosed and are not, or the other way round, among n. Errors of T are those of the
points around the annulus, against the exact shortest path around its corners, in % of it: largest
where the straight way out is free, which the solver is told as a lower bound, and where the annulus
hides it ("behind"). At 1 / leak times the free slowness a wall that is a fraction of a cell too
thin on the grid costs T in the cavity dearly."""
POINT_NOTES = """\
T of single points at the finest grid, s, and the exact shortest path to the circle at speed 1. A
and C have to go around a corner of the annulus; B has the straight way out."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        annulus: the obstacle and the disc.
        star: the point mass in the cavity, m.
        points: free points by name, m; the escape path of the first is drawn.
        leak: speed inside the leaky wall.
        resolutions: nodes a side of the grids; the last one is drawn.
        samples: random points in the disc.
    """

    annulus: Annulus = field(default_factory=Annulus)
    star: tuple[float, float] = (0.53, 0.15)
    points: tuple[tuple[str, float, float], ...] = (
        ("A", 0.12, 0.05),
        ("B", -0.5, 0.35),
        ("C", 0.1, 0.12),
    )
    leak: float = 0.05
    resolutions: tuple[int, ...] = (100, 200, 400, 800)
    samples: int = 100_000

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(resolutions=(64,), samples=2000)


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/eikonal-toy.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    folder = Path(out_dir)
    walls = {"hard": 0.0, f"leaky, {settings.leak:g}": settings.leak}
    scene = {
        "annulus": asdict(settings.annulus),
        "star": settings.star,
        "samples": settings.samples,
    }
    scene["points"] = [point[1:] for point in settings.points]
    cases = [(wall, leak, nodes) for wall, leak in walls.items() for nodes in settings.resolutions]
    works = [
        Work({**scene, "leak": leak, "resolution": nodes}, SEED, f"{wall}, {nodes} nodes")
        for wall, leak, nodes in cases
    ]
    records = run_recorded(
        DO, works, folder / "records.jsonl", jobs, Context(), "solving" if progress else ""
    )
    results = [record["result"] for record in records]
    rows = [
        {"wall": wall, "nodes a side": nodes, **_columns(result)}
        for (wall, _, nodes), result in zip(cases, results, strict=True)
    ]
    hard, leaky = (results[k * len(settings.resolutions) - 1] for k in (1, 2))
    return [
        *write_table(folder, rows, "A point mass in a square annulus", NOTES),
        *write_table(
            folder, _point_rows(settings, hard, leaky), "Single points", POINT_NOTES, name="points"
        ),
        escape_times(
            [_panel(settings, wall, leak) for wall, leak in walls.items()],
            folder / "escape_time.png",
        ),
    ]


def solve_once(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Solve one grid and hold it against what is known exactly.

    Args:
        spec: annulus, leak, resolution, star, points and samples.
        seed: of the random points.
        context: not needed.

    Returns:
        T at the star and the points with the exact values; areas; how many of the random points are
        misjudged; errors of those outside.
    """
    annulus = Annulus(**spec["annulus"])
    solved = ObstacleField(
        annulus.walls, annulus.radius, even_speed(spec["leak"]), spec["resolution"]
    )
    star = np.array(spec["star"])
    points = np.array(spec["points"])
    drawn = solved.solve()
    enclosed = np.isinf(drawn.T) & (drawn.speed == 1.0)
    return {
        "h": solved.h,
        "star": solved.query(star),
        "star_exact": annulus.leaky_time(star, spec["leak"]),
        "area": enclosed.sum() * solved.h**2,
        "area_exact": annulus.cavity_area * (spec["leak"] == 0),
        "points": solved.query(points),
        "points_exact": annulus.exit_distance(points),
        **_sampled(annulus, solved, spec["samples"], seed),
    }


def _sampled(annulus: Annulus, solved: ObstacleField, count: int, seed: int) -> dict[str, Any]:
    """How the field does at random points of the disc."""
    rng = np.random.default_rng(seed)
    r = annulus.radius * np.sqrt(rng.uniform(size=count))
    angle = rng.uniform(0, 2 * np.pi, count)
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    caged = annulus.depth(points, annulus.inner) > 0
    outside = annulus.depth(points, annulus.outer) < 0
    T = solved.query(points)
    exact = annulus.exit_distance(points[outside])
    wrong = np.isinf(T) != (caged & (solved.speed.leak == 0))
    error = np.abs(T[outside] - exact) / exact
    hidden = exact > (annulus.radius - r[outside]) * (1 + LONGER)
    return {
        "n": int((caged | outside).sum()),
        "misjudged": int(wrong[caged | outside].sum()),
        "hidden": int(hidden.sum()),
        "straight_error": error[~hidden].max(),
        "error_median": np.median(error[hidden]),
        "error_99": np.percentile(error[hidden], 99),
        "error_most": error[hidden].max(),
    }


def _columns(result: dict[str, Any]) -> dict[str, Any]:
    """One row of the table, after its name."""
    return {
        "h, m": result["h"],
        "T at the star": result["star"],
        "exact T": result["star_exact"],
        "T off": _off(result["star"], result["star_exact"]),
        "enclosed, m^2": f"{result['area']:.5f}",
        "exact": f"{result['area_exact']:.5f}",
        "enclosed off": _off(result["area"], result["area_exact"]),
        "n": result["n"],
        "misjudged": result["misjudged"],
        "straight way, largest": _percent(result["straight_error"]),
        "behind, n": result["hidden"],
        "behind, median": _percent(result["error_median"]),
        "behind, p99": _percent(result["error_99"]),
        "behind, largest": _percent(result["error_most"]),
    }


def _percent(share: float) -> str:
    return "0 %" if share < 1e-9 else f"{100 * share:.2g} %"


def _off(value: float, exact: float) -> str:
    """Relative error."""
    return _percent(0.0 if value == exact else abs(value - exact) / exact)


def _point_rows(
    settings: Settings, hard: dict[str, Any], leaky: dict[str, Any]
) -> list[dict[str, Any]]:
    columns = zip(
        settings.points, hard["points"], leaky["points"], hard["points_exact"], strict=True
    )
    return [
        {
            "point": name,
            "x, m": x,
            "y, m": y,
            "straight line, m": settings.annulus.radius - float(np.hypot(x, y)),
            "exact T": exact,
            "T, hard wall": T,
            "off": _off(T, exact),
            "T, leaky wall": T_leaky,
        }
        for (name, x, y), T, T_leaky, exact in columns
    ]


def _panel(settings: Settings, wall: str, leak: float) -> ObstaclePanel:
    annulus = settings.annulus
    solved = ObstacleField(
        annulus.walls, annulus.radius, even_speed(leak), settings.resolutions[-1]
    )
    name, x, y = settings.points[0]
    return ObstaclePanel(
        title=f"{wall.partition(',')[0]} wall",
        field_map=solved.solve(),
        outlines=(annulus.outline(annulus.outer), annulus.outline(annulus.inner)),
        radius=annulus.radius,
        star=np.array(settings.star),
        point=(name, np.array([x, y])),
        paths=tuple(_paths(solved, [settings.star, (x, y)])),
    )


def _paths(solved: ObstacleField, points: Sequence[Sequence[float]]) -> list[np.ndarray]:
    """Escape paths of the points that can escape."""
    paths = [solved.escape_path(np.array(point)) for point in points]
    return [path for path in paths if len(path) > 1]
