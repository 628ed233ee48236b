"""The contact step and the escape fields, on one core."""

from __future__ import annotations

from functools import partial

import numpy as np

from evaluation.bench.base import Row, Sizes, make_started, median_seconds, row
from piec_envs import (
    Commands,
    GridField,
    MissingDependencyError,
    Plant,
    QuasiDynamics,
    make_model,
    provenance,
)


def contact_step(sizes: Sizes) -> list[Row]:
    """The quasi-dynamic step on one core, compiled and with an OSQP problem set up in each step.

    The arm curls towards the object and pushes it along; both solvers do the same motion.
    """
    _, state = make_started(escape_field=None)
    actions = np.random.default_rng(0).uniform(0.4, 0.6, (sizes.rows, sizes.motion, 4))
    found = {}
    for solver, rows, repeats in (("fast", sizes.rows, sizes.repeats), ("osqp", 1, 3)):
        dynamics = QuasiDynamics(solver, threads=1)
        q_r, q_cmd, pose = (
            np.repeat(value, rows, axis=0) for value in (state.q_r, state.q_cmd, state.pose)
        )
        plant = Plant("planar_arm", ["circle"] * rows, np.full(rows, 0.5))
        call = partial(dynamics.rollout, q_r, q_cmd, pose, Commands(actions[:rows]), plant)
        share = float(call().contact[:, 1:].any(axis=2).mean())
        found[solver] = median_seconds(call, repeats) / (rows * sizes.motion), share
    (fast, share) = found["fast"]
    (osqp, osqp_share) = found["osqp"]
    return [
        row(
            "contact step, fast",
            1e6 * fast,
            "us",
            "",
            f"one core, in contact {100 * share:.0f} % of the steps",
        ),
        row(
            "contact step, osqp",
            1e6 * osqp,
            "us",
            "",
            f"one core, in contact {100 * osqp_share:.0f} % of the steps",
        ),
        row("contact step, fast over osqp", osqp / fast, "times", "at least 300", "per core"),
    ]


def franka_steps(sizes: Sizes) -> list[Row]:
    """Batched rollouts of the mobile Franka on one core while its arm carries a caged object, and
    all they measure.
    """
    rows = []
    for name, wanted in (("circle_119", "at most 3"), ("box_212", "at most 10")):
        for sigma in (0.0, 0.005):
            label = f"step of the mobile Franka, {name}{', noise' if sigma else ''}"
            try:
                rows.append(_carry(sizes, name, sigma, label, wanted))
            except MissingDependencyError as error:
                rows.append({**row(label, np.nan, "us"), "note": str(error)})
    return rows


def _carry(sizes: Sizes, name: str, sigma: float, label: str, wanted: str) -> Row:
    """Time of a step while the base carries the object to the goal and the arm closes on it a
    little.
    """
    model = make_model(
        "piec_envs/MobileFrankaPush-v0",
        start="cage",
        object=name,
        disturbance=sigma,
        escape_field=None,
        threads=1,
    )
    time = np.arange(1, sizes.motion + 1) / sizes.motion
    task = model.task
    path = np.tile(model.setup.posture, (sizes.rows, sizes.motion, 1))
    path[:, :, :2] += np.minimum(1.0, time / 0.6)[:, None] * (task.goal - task.start[:2])
    path[:, :, 3:] -= (
        0.1 * time[None, :, None] * np.random.default_rng(0).uniform(0, 1, (sizes.rows, 1, 2))
    )
    states = model.reset(0).take([0] * sizes.rows)
    states.seed = np.arange(sizes.rows)
    call = partial(model.rollout, states, path, absolute=True)
    share = float((call().motion.active[:, 1:] > 0).mean())
    seconds = median_seconds(call, sizes.repeats) / (sizes.rows * sizes.motion)
    return row(
        label, 1e6 * seconds, "us", wanted, f"one core, in contact {100 * share:.0f} % of the steps"
    )


def slowest_steps(sizes: Sizes) -> list[Row]:
    """Time of a step state by state, while arms close on an object until it is squeezed.

    Each state is timed as a batch of equal rows, so that the call itself does not count.
    """
    rng = np.random.default_rng(0)
    rows = sizes.rows
    copies = 256
    q = np.array([0.0, 1.2, 1.5, 1.5]) + rng.uniform(-0.1, 0.1, (rows, 4))
    pose = np.column_stack(
        [0.4 + rng.uniform(-0.03, 0.03, rows), 0.2 + rng.uniform(-0.03, 0.03, rows), np.zeros(rows)]
    )
    dynamics = QuasiDynamics("fast", threads=1)
    closing = Commands(np.tile([0.0, 1.0, 1.0, 1.0], (rows, 400, 1)))
    motion = dynamics.rollout(
        q, q, pose, closing, Plant("planar_arm", ["circle"] * rows, np.full(rows, 0.5))
    )
    plant = Plant("planar_arm", ["circle"] * copies, np.full(copies, 0.5))
    one = Commands(np.tile([0.0, 1.0, 1.0, 1.0], (copies, 1, 1)))
    times = []
    active = []
    for i, t in zip(
        rng.integers(rows, size=sizes.states), rng.integers(400, size=sizes.states), strict=True
    ):
        q_r, q_cmd, here = (
            np.repeat(array[i, t][None], copies, axis=0)
            for array in (motion.q_r, motion.q_cmd, motion.pose)
        )
        times.append(
            median_seconds(partial(dynamics.rollout, q_r, q_cmd, here, one, plant), 5) / copies
        )
        active.append(motion.active[i, t + 1])
    median = np.median(times)
    slow = np.percentile(times, 99)
    note = (
        f"{sizes.states} states, {100 * np.mean(np.array(active) >= 3):.0f} % with three or "
        f"more active multipliers"
    )
    return [
        row("contact step, median state", 1e6 * median, "us", "", note),
        row("contact step, slowest percentile over median", slow / median, "times", "at most 10"),
    ]


def escape_fields(sizes: Sizes, resolution: int = 100) -> list[Row]:
    """The grid solvers on one core, speed map included, and scikit-fmm on the same grid without it.

    Args:
        sizes: how much is measured.
        resolution: nodes a side.

    Returns:
        Lines of the table.
    """
    rng = np.random.default_rng(0)
    q = rng.uniform(-2.6, 2.6, (sizes.fields, 4))
    points = np.tile([[[0.35, 0.1]]], (sizes.fields, 1, 1))
    seconds = {}
    rows = []
    for method in ("marching", "sweeping"):
        field = GridField("planar_arm", resolution, method, threads=1)
        seconds[method] = (
            median_seconds(partial(field.query, points, q), sizes.repeats) / sizes.fields
        )
        rows.append(
            row(
                f"field, {method}",
                1e3 * seconds[method],
                "ms",
                "",
                f"one core, {resolution} x {resolution}",
            )
        )
    reference = _scikit_fmm(q, resolution, sizes.repeats)
    if reference is None:
        note = f"needs scikit-fmm: {provenance.install_command('dev')}"
        return [*rows, {**row("field, scikit-fmm", np.nan, "ms"), "note": note}]
    rows.append(
        row("field, scikit-fmm", 1e3 * reference, "ms", "", "second order, speed map not counted")
    )
    for method, wanted in (("marching", "at least 1.2"), ("sweeping", "at least 3")):
        rows.append(
            row(
                f"{method} over scikit-fmm",
                reference / seconds[method],
                "times",
                wanted,
                "per core",
            )
        )
    return rows


def _scikit_fmm(q: np.ndarray, resolution: int, repeats: int) -> float | None:
    """Seconds of scikit-fmm's second-order march for each configuration, None without it."""
    try:
        import skfmm
    except ImportError:
        return None
    field = GridField("planar_arm", resolution, threads=1)
    maps = [field.solve(configuration) for configuration in q]
    x, y = np.meshgrid(maps[0].x, maps[0].y)  # (N, N)
    inside = 1.4 - np.hypot(x, y)  # zero on the escape set's boundary, m
    ring = np.ma.masked_array(inside, inside < -2 * (x[0, 1] - x[0, 0]))

    def run() -> None:
        """March over every map."""
        for item in maps:
            skfmm.travel_time(ring, item.speed, dx=float(x[0, 1] - x[0, 0]), order=2)

    return median_seconds(run, repeats) / len(q)
