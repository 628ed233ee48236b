"""The rigid model, whose rows often depend on each other: the compiled solver against OSQP and
linear programming.
"""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.optimize import linprog

from piec_envs.dynamics.active_set import make_dual, solve_dual
from piec_envs.dynamics.contact_model import PAPER_MODEL
from piec_envs.dynamics.contact_qp import ContactProblem, ContactSolution, solve_osqp
from piec_envs.dynamics.protocol import CONTROL_PERIOD, Commands, Plant
from piec_envs.dynamics.quasi_dynamic import QuasiDynamics
from piec_envs.dynamics.reference import assemble_problem
from piec_envs.dynamics.rigid import FAILED
from piec_envs.world.packed import pack_scene
from piec_envs.world.robots import get_robot

SOLVERS = ("fast", "osqp")
FRANKAS = ("mobile_franka_capsules", "franka_capsules")  # whose polygons pinch a box
PINCHED = {
    "q_r": (
        0.4065530000000003,
        0.2885110000000011,
        -0.7040409999999515,
        -2.018202471050112,
        0.7834921610832165,
    ),
    "q_cmd": (0.406553, 0.288511, -0.704041, -3.0718, -0.0175),
    "pose": (0.3954421250684628, 0.039333869530638145, 0.49733155046514804),
}


def solve_fast(problem: ContactProblem) -> ContactSolution:
    dual = make_dual(problem.weight, len(problem.gap))
    value = problem.rows @ problem.free + problem.gap
    active = solve_dual(problem.rows, len(value), problem.compliance, value, False, dual)
    multipliers = dual.multipliers
    step = problem.free + problem.rows.T @ multipliers / problem.weight
    return ContactSolution(step, multipliers, solved=active != FAILED)


def least_violation(problem: ContactProblem) -> float:
    """Least slack with which some step meets all constraints, m: 0 where the problem has a
    solution.
    """
    m, d = problem.rows.shape
    found = linprog(
        np.eye(d + 1)[d],
        A_ub=-np.hstack([problem.rows, np.ones((m, 1))]),
        b_ub=problem.gap,
        bounds=[(None, None)] * d + [(0, None)],
        method="highs",
    )
    return float(found.x[-1])


def pinched(robot_name: str, rows: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Arms that have closed on a box, with three multipliers or more: q_r and poses."""
    rng = np.random.default_rng(seed)
    robot = get_robot(robot_name)
    base = robot.base_dof
    n = robot.dof
    tries = 400 * rows
    lower = robot.joint_array("lower").copy()
    upper = robot.joint_array("upper").copy()
    lower[:base] = -0.3
    upper[:base] = 0.3
    q = rng.uniform(lower, upper, (tries, n))
    pose = np.column_stack([rng.uniform(-0.6, 0.6, (tries, 2)), rng.uniform(-3, 3, tries)])
    pose[:, :base] += q[:, :base]
    dynamics = QuasiDynamics()
    still = Commands(np.zeros((tries, 0, n)))
    plant = Plant(robot_name, ["box_212"] * tries, np.full(tries, 0.5))
    nearest = np.sort(dynamics.rollout(q, q, pose, still, plant).link_distance[:, 0], axis=1)
    kept = np.flatnonzero((nearest[:, 0] > 0) & (nearest[:, 1] < 0.12))[: 40 * rows]
    closing = np.repeat(rng.choice([-1.0, 1.0], (len(kept), 1, n)), 300, axis=1)
    closing[:, :, :base] = 0.0
    plant = Plant(robot_name, ["box_212"] * len(kept), np.full(len(kept), 0.5))
    motion = dynamics.rollout(q[kept], q[kept], pose[kept], Commands(closing), plant)
    held = np.flatnonzero(motion.active[:, -1] >= 3)[:rows]
    return motion.q_r[held, -1], motion.pose[held, -1]


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_pinched_box_stays_where_it_is(solver):
    env = gym.make(
        "piec_envs/MobileFrankaPush-v0",
        geometry="capsules",
        preset="paper",
        object="box_212",
        escape_field=None,
        prior="contact",
        solver=solver,
    ).unwrapped
    env.reset(seed=0, options={"state": PINCHED})
    info = env.step(np.array([0.0, 0.0, 0.0, -1.0, -1.0]))[4]
    state = env.get_state()
    assert not info["diverged"]
    np.testing.assert_allclose(state.pose[0], PINCHED["pose"], atol=1e-6)
    np.testing.assert_allclose(state.q_r[0], PINCHED["q_r"], atol=1e-6)


def compare_with_osqp(robot_name: str, rows: int, commands: int) -> int:
    """Rigid steps of both solvers from pinched states, the command up to 1 rad ahead; returns how
    many it compared.
    """
    (q, pose) = pinched(robot_name, rows, seed=0)
    robot = get_robot(robot_name)
    rng = np.random.default_rng(1)
    scene = pack_scene(robot_name, "box_212")
    compared = 0
    limits = robot.joint_array("lower"), robot.joint_array("upper")
    for i, _ in np.ndindex(len(q), commands):
        lead = rng.choice([0.005, 0.05, 1.0]) * rng.uniform(-1, 1, robot.dof)
        problem = assemble_problem(
            scene, PAPER_MODEL, 0.5, q[i], np.clip(q[i] + lead, *limits), pose[i], np.zeros(2)
        )
        fast = solve_fast(problem)
        reference = solve_osqp(problem)
        if not fast.solved:
            assert not reference.solved and least_violation(problem) > 1e-9
        else:
            assert problem.residual(fast) < 1e-7  # of multipliers up to 1e7, where links jam
        if fast.solved and reference.solved:  # OSQP takes some that have a solution for infeasible
            np.testing.assert_allclose(fast.step, reference.step, atol=1e-8)
            compared += 1
    return compared


@pytest.mark.parametrize("robot_name", FRANKAS)
def test_fast_equals_osqp_on_pinched_boxes(robot_name):
    assert compare_with_osqp(robot_name, rows=10, commands=5) >= 30


@pytest.mark.slow
@pytest.mark.parametrize("robot_name", FRANKAS)
def test_fast_equals_osqp_on_pinched_boxes_and_2000_commands(robot_name):
    assert compare_with_osqp(robot_name, rows=50, commands=20) >= 900


@settings(max_examples=80)
@given(data=st.data())
def test_rigid_answers_are_right_or_there_is_none(data):
    """Rows of few values, repeated and mixed, so that most depend on others; the oracle is linear
    programming.
    """
    d = 7
    m = data.draw(st.integers(1, 6))
    rows = data.draw(
        hnp.arrays(float, (m, d), elements=st.sampled_from([-1.0, -0.5, 0.0, 0.5, 1.0]))
    )
    rows[np.abs(rows).sum(axis=1) == 0] = 0.5  # a contact row is never zero
    mixed = data.draw(
        hnp.arrays(
            float, (data.draw(st.integers(0, 8)), m), elements=st.sampled_from([-1.0, 0.0, 1.0])
        )
    )
    added = mixed @ rows
    rows = np.vstack([rows, added[np.abs(added).sum(axis=1) > 0]])
    gaps = st.floats(-0.01, 0.01).map(lambda v: round(v, 4))
    gap = data.draw(hnp.arrays(float, len(rows), elements=gaps))
    free = data.draw(hnp.arrays(float, d, elements=st.floats(-0.5, 0.5).map(lambda v: round(v, 2))))
    problem = ContactProblem(np.array([500.0] * 4 + [100.0, 100.0, 42.0]), free, rows, gap, 0.0)
    found = solve_fast(problem)
    if found.solved:
        assert problem.residual(found) < 1e-10
    else:
        assert least_violation(problem) > 1e-9


def rigid_motion(robot_name: str, rows: int, steps: int):
    """Random actions, held for 50 steps, from pinched states under the paper's model."""
    q, pose = pinched(robot_name, rows, seed=2)
    rng = np.random.default_rng(3)
    n = q.shape[1]
    actions = np.repeat(rng.uniform(-1, 1, (len(q), steps // 50, n)), 50, axis=1)
    plant = Plant(robot_name, ["box_212"] * len(q), np.full(len(q), 0.5))
    return QuasiDynamics(model=PAPER_MODEL).rollout(q, q, pose, Commands(actions), plant)


def check_steps(motion, robot) -> int:
    """Where nothing overlaps no step is longer than the lead of the command; returns the number of
    steps.

    A joint that a command ahead without limit winds up springs back by all of it at once: that is
    the paper's model.
    """
    step = np.abs(np.diff(motion.q_r, axis=1))  # (B, N, n)
    lead = motion.q_cmd[:, 1:] - motion.q_r[:, :-1]
    stiffness = robot.joint_array("stiffness")
    limit = CONTROL_PERIOD * robot.joint_array("speed_limit")
    lengths = [np.sqrt((stiffness * each**2).sum(axis=2)) for each in (step, lead)]
    apart = motion.link_distance[:, :-1].min(axis=2) >= 0
    assert (lengths[0] <= lengths[1] * (1 + 1e-6) + 1e-12)[apart].all()
    assert (step <= 2.1 * limit)[apart & (np.abs(lead) <= 2 * limit).all(axis=2)].all()
    return step.shape[0] * step.shape[1]


@pytest.mark.parametrize("robot_name", [*FRANKAS, "planar_arm"])
def test_rigid_steps_keep_to_the_lead(robot_name):
    assert check_steps(rigid_motion(robot_name, 8, 100), get_robot(robot_name)) >= 300


@pytest.mark.slow
@pytest.mark.parametrize("robot_name", [*FRANKAS, "planar_arm"])
def test_a_hundred_thousand_rigid_steps_keep_to_the_lead(robot_name):
    assert check_steps(rigid_motion(robot_name, 60, 1700), get_robot(robot_name)) >= 100_000
