"""Laws of the quasi-dynamic model, and the compiled solver against OSQP."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from piec_envs.dynamics.active_set import make_dual, solve_dual
from piec_envs.dynamics.contact_model import PAPER_MODEL, ContactModel
from piec_envs.dynamics.contact_qp import ContactProblem, ContactSolution, solve_osqp
from piec_envs.dynamics.mujoco_ import MujocoDynamics
from piec_envs.dynamics.protocol import CONTROL_PERIOD, Commands, Plant
from piec_envs.dynamics.quasi_dynamic import QuasiDynamics
from piec_envs.dynamics.reference import assemble_problem
from piec_envs.errors import InvalidParameterError, InvalidStateError, UnknownNameError
from piec_envs.world.objects import OBJECTS
from piec_envs.world.packed import pack_scene
from piec_envs.world.robots import get_robot

RIGID = [name for name, item in OBJECTS.items() if not item.loose]  # every dynamics moves them
ROBOT = get_robot("planar_arm")


def solve_fast(problem: ContactProblem, guess: bool = True) -> ContactSolution:
    """The compiled active-set solver on a problem object."""
    m = len(problem.gap)
    dual = make_dual(problem.weight, m)
    value = problem.rows @ problem.free + problem.gap
    solve_dual(problem.rows, m, problem.compliance, value, guess, dual)
    multipliers = dual.multipliers
    return ContactSolution(
        problem.free + problem.rows.T @ multipliers / problem.weight, multipliers
    )


@pytest.mark.slow
@pytest.mark.parametrize("object_name", RIGID)
def test_fast_equals_osqp(object_name, random_motion):
    """2,000 states of each object, at least 400 of them with three or more active multipliers."""
    motion = random_motion(object_name, seed=1)
    scene = pack_scene("planar_arm", object_name)
    model = ContactModel()
    active = motion.active[:, 1:]
    draw = np.random.default_rng(0).permutation
    many = draw(np.argwhere(active >= 3))
    few = draw(np.argwhere(active < 3))
    picked = np.concatenate([many[:400], few[:1600]])
    assert len(picked) == 2000
    for i, t in picked:
        state = motion.q_r[i, t], motion.q_cmd[i, t + 1], motion.pose[i, t]
        problem = assemble_problem(scene, model, 0.5, *state, np.zeros(2))
        fast = solve_fast(problem)
        reference = solve_osqp(problem)
        np.testing.assert_allclose(solve_fast(problem, guess=False).step, fast.step, atol=1e-12)
        np.testing.assert_allclose(fast.step, reference.step, atol=1e-9)
        assert problem.residual(fast) < 1e-12
        taken = np.concatenate(
            [motion.q_r[i, t + 1] - motion.q_r[i, t], motion.pose[i, t + 1] - motion.pose[i, t]]
        )
        np.testing.assert_allclose(taken, fast.step, atol=1e-12)


@settings(max_examples=60)
@given(data=st.data())
def test_fast_satisfies_kkt_on_any_problem(data):
    d = 7
    m = data.draw(st.integers(1, 16))
    entries = st.floats(-1, 1).map(lambda v: round(v, 3))
    rows = data.draw(hnp.arrays(float, (m, d), elements=entries))
    gap = data.draw(
        hnp.arrays(float, m, elements=st.floats(-0.01, 0.01).map(lambda v: round(v, 5)))
    )
    free = data.draw(
        hnp.arrays(float, d, elements=st.floats(-0.02, 0.02).map(lambda v: round(v, 5)))
    )
    weight = np.array([500.0] * 4 + [100.0, 100.0, 42.0])
    rows[np.abs(rows).sum(axis=1) < 0.1] = 0.5  # a contact row is never zero
    problem = ContactProblem(weight, free, rows, gap, 1e-4)
    for guess in (True, False):
        assert problem.residual(solve_fast(problem, guess)) < 1e-9


def test_rollout_with_osqp_equals_fast(random_motion):
    fast = random_motion("square", rows=4, steps=80, seed=5, sigma=0.003)
    reference = random_motion(
        "square", rows=4, steps=80, seed=5, sigma=0.003, dynamics=QuasiDynamics("osqp")
    )
    np.testing.assert_allclose(fast.pose, reference.pose, atol=1e-6)
    np.testing.assert_allclose(fast.q_r, reference.q_r, atol=1e-6)
    np.testing.assert_array_equal(fast.contact, reference.contact)


@pytest.mark.parametrize("sigma", [0.0, 0.005])
@pytest.mark.parametrize("object_name", RIGID)
def test_motion_keeps_its_laws(object_name, sigma, random_motion):
    motion = random_motion(object_name, seed=2, sigma=sigma)
    for array in (motion.q_r, motion.q_cmd, motion.pose, motion.link_distance):
        assert np.isfinite(array).all()
    assert (motion.active > 0).mean() > 0.1
    assert -motion.link_distance.min() < 1e-3
    lead = ROBOT.joint_array("max_lead")
    assert (np.abs(np.diff(motion.q_r, axis=1)) <= lead + 1e-12).all()
    assert (np.abs(motion.q_cmd[:, 1:] - motion.q_r[:, :-1]) <= lead + 1e-12).all()
    commands = motion.q_cmd[:, 1:]
    assert (commands >= ROBOT.joint_array("lower")).all() and (
        commands <= ROBOT.joint_array("upper")
    ).all()
    if sigma == 0:
        untouched = motion.active[:, 1:] == 0
        moved = (motion.pose[:, 1:] != motion.pose[:, :-1]).any(axis=2)
        assert not (moved & untouched).any()


def test_free_joint_follows_the_command_exactly():
    q = np.zeros((1, 4))
    pose = np.array([[5.0, 5.0, 0.0]])
    plant = Plant("planar_arm", ["circle"], np.array([0.5]))
    motion = QuasiDynamics().rollout(q, q, pose, Commands(np.ones((1, 400, 4))), plant)
    expected = np.zeros(4)
    for t in range(400):
        expected = expected + CONTROL_PERIOD * (1.0 * ROBOT.speed_limit)
        np.testing.assert_array_equal(motion.q_r[0, t + 1], expected)


def test_rows_do_not_depend_on_batch_or_threads(random_motion):
    motion = random_motion("hexagon", rows=20, steps=100, seed=3)
    rows = len(motion.pose)
    commands = Commands(motion.actions)
    start = motion.q_r[:, 0], motion.q_cmd[:, 0], motion.pose[:, 0]
    for threads in (1, 2, 3):
        plant = Plant("planar_arm", ["hexagon"] * rows, np.full(rows, 0.5))
        again = QuasiDynamics(threads=threads).rollout(*start, commands, plant)
        np.testing.assert_array_equal(again.pose, motion.pose)
    for i in (0, rows - 1):
        plant = Plant("planar_arm", ["hexagon"], np.array([0.5]))
        one = [array[i : i + 1] for array in start]
        again = QuasiDynamics().rollout(*one, Commands(motion.actions[i : i + 1]), plant)
        np.testing.assert_array_equal(again.pose[0], motion.pose[i])


def test_rows_of_other_objects_frictions_and_inertias_equal_separate_rows(random_motion):
    motion = random_motion("octagon", rows=8, steps=150, seed=4)
    rows = len(motion.pose)
    names = (["circle", "octagon"] * rows)[:rows]
    friction = np.linspace(0.0, 1.0, rows)
    inertia = (["own", "own", "paper"] * rows)[:rows]
    start = motion.q_r[:, 0], motion.q_cmd[:, 0], motion.pose[:, 0]
    plant = Plant("planar_arm", names, friction, inertia=inertia)
    mixed = QuasiDynamics().rollout(*start, Commands(motion.actions), plant)
    for i in range(rows):
        plant = Plant("planar_arm", [names[i]], friction[i : i + 1], inertia=inertia[i : i + 1])
        one = [array[i : i + 1] for array in start]
        alone = QuasiDynamics().rollout(*one, Commands(motion.actions[i : i + 1]), plant)
        np.testing.assert_array_equal(alone.pose[0], mixed.pose[i])


def test_push_out_limits_how_fast_an_overlap_is_resolved():
    # 35 mm inside the second link
    q = np.zeros((1, 4))
    pose = np.array([[0.6, 0.09, 0.0]])
    plant = Plant("planar_arm", ["circle"], np.array([0.5]))
    motion = QuasiDynamics().rollout(q, q, pose, Commands(np.zeros((1, 10, 4))), plant)
    steps = np.diff(motion.link_distance.min(axis=2)[0])
    assert steps.max() <= 0.0101
    assert motion.link_distance[0, -1].min() > -1e-4


def test_paper_preset_winds_up_and_default_does_not():
    """A squeezed arm: without max_lead the command runs ahead of the joints."""
    q = np.array([[0.0, 1.2, 1.6, 1.6]])
    pose = np.array([[0.45, 0.25, 0.0]])
    plant = Plant("planar_arm", ["circle"], np.array([0.5]))
    commands = Commands(np.tile([0.0, 1.0, 1.0, 1.0], (1, 500, 1)))
    leads = {}
    for name, model in (
        ("default", ContactModel()),
        ("paper", PAPER_MODEL._replace(compliance=1e-4)),
    ):
        motion = QuasiDynamics(model=model).rollout(q, q, pose, commands, plant)
        leads[name] = np.abs(motion.q_cmd - motion.q_r).max()
    assert leads["default"] < 0.02
    assert leads["paper"] > 5 * leads["default"]


def test_arrays_that_do_not_fit_are_refused():
    q = np.zeros((3, 4))
    pose = np.zeros((3, 3))
    plant = Plant("planar_arm", ["circle"] * 3, np.full(3, 0.5))
    good = Commands(np.zeros((3, 5, 4)))
    for arrays in (
        (q[:2], q, pose, good, plant),
        (q, q, pose[:, :2], good, plant),
        (q, q, pose, Commands(np.zeros((3, 5, 3))), plant),
        (q, q, pose, Commands(np.zeros((3, 5, 4)), displacement=np.zeros((3, 4, 2))), plant),
        (q, q, pose, good, Plant("planar_arm", ["circle"] * 20, np.full(3, 0.5))),
        (q, q, pose, good, Plant("planar_arm", ["circle"] * 3, np.full(2, 0.5))),
    ):
        with pytest.raises(InvalidStateError):
            QuasiDynamics().rollout(*arrays)


def test_bad_arguments():
    with pytest.raises(UnknownNameError, match="fast, osqp"):
        QuasiDynamics(solver="slow")
    with pytest.raises(InvalidParameterError, match="compliance"):
        QuasiDynamics(model=ContactModel(compliance=-1.0))


def test_with_its_own_inertia_an_object_turns_with_the_face_that_pushes_it():
    """A link pushes the long side of a box: under MuJoCo the two stay face to face, with the
    paper's entry not.
    """
    q = np.zeros((1, 4))
    pose = np.array([[1.1, 0.17, 0.0]])
    commands = Commands(np.tile([1.0, 0, 0, 0], (1, 100, 1)))
    behind = {}
    for name, dynamics, inertia in (
        ("mujoco", MujocoDynamics(), "paper"),
        ("own", QuasiDynamics(), "own"),
        ("own, osqp", QuasiDynamics("osqp"), "own"),
        ("paper", QuasiDynamics(), "paper"),
    ):
        plant = Plant("planar_arm", ["box"], np.array([0.5]), inertia=[inertia])
        motion = dynamics.rollout(q, q, pose, commands, plant)
        behind[name] = motion.q_r[0, -1, 0] - motion.pose[0, -1, 2]  # rad
    assert behind["paper"] > 0.25
    assert abs(behind["own"]) < 0.01 and abs(behind["mujoco"]) < 0.03
    assert behind["own, osqp"] == pytest.approx(behind["own"], abs=1e-5)
