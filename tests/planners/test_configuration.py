"""Static caging: the problem's gradients and penalty, and what CMA-ES and SQP find."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from piec_envs.errors import InvalidParameterError, InvalidStateError, UnknownNameError
from piec_envs.escape.field import make_field, object_escape_time
from piec_envs.model.caging_problem import COLLISION_WEIGHT, Postures
from piec_envs.world.objects import OBJECTS, get_object
from planners import CagingProblem, CmaEsConfiguration, SqpConfiguration
from planners.posture_starts import draw_postures
from planners.sqp import step_size

POSE = np.array([-0.27, 0.09, -2.14])
FIELD = make_field("grid", resolution=64, method="marching", threads=1)
SMALL = {
    CmaEsConfiguration: {"population": 20, "iterations": 15},
    SqpConfiguration: {"iterations": 20},
}


def problem_of(object_name="three_discs", pose=POSE, **choice) -> CagingProblem:
    return CagingProblem(
        "planar_arm", object_name, pose, choice.pop("field", FIELD), threads=1, **choice
    )


def postures(problem: CagingProblem, rows: int, seed: int = 0) -> np.ndarray:
    return draw_postures(problem, "curled", rows, np.random.default_rng(seed))


# --- the problem -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", OBJECTS)
def test_constraint_gradients_are_finite_differences(name):
    problem = problem_of(name)
    h = 1e-6
    # many overlap object or self
    q = draw_postures(problem, "uniform", 200, np.random.default_rng(1))
    phi, dphi = problem.constraints(q)
    steps = h * np.eye(4)
    slopes = [
        (problem.constraints(q + e)[0] - problem.constraints(q - e)[0]) / (2 * h) for e in steps
    ]
    assert (phi < 0).any() and (phi > 0).any()
    smooth = np.abs(np.stack(slopes, axis=-1) - dphi) < 1e-6
    assert smooth.mean() > 0.999  # but where the closest features change within h


def test_one_constraint_for_each_link_and_shape_then_pairs_of_links():
    assert problem_of().measure(np.zeros((1, 4))).phi.shape == (1, 4 * 3 + 3)
    free = problem_of(avoid_self_overlap=False, clearance=0.01)
    assert free.measure(np.zeros((1, 4))).phi.shape == (1, 12)
    q = postures(free, 5)
    np.testing.assert_allclose(free.measure(q).phi, problem_of().measure(q).phi[:, :12] - 0.01)


@pytest.mark.parametrize("reduce", ["mean", "max"])
def test_escape_time_gradient_is_a_finite_difference(reduce):
    problem = problem_of(reduce=reduce)
    h = 1e-3
    q = postures(problem, 300)
    judged = problem.measure(q)
    q = q[judged.feasible]
    times, slopes = problem.escape_time(q)
    np.testing.assert_allclose(times, judged.escape_time[judged.feasible])
    q = q[np.linalg.norm(slopes, axis=1) > 1]
    slopes = slopes[np.linalg.norm(slopes, axis=1) > 1]
    steps = h * np.eye(4)
    numeric = np.stack(
        [(problem.escape_time(q + e)[0] - problem.escape_time(q - e)[0]) / (2 * h) for e in steps],
        -1,
    )
    cosine = (
        (slopes * numeric).sum(axis=1)
        / np.linalg.norm(slopes, axis=1)
        / np.linalg.norm(numeric, axis=1)
    )
    # a change of the escape route makes single ones jump
    assert len(q) > 5 and np.median(cosine) > 0.99


def test_value_is_the_escape_time_of_the_object_less_a_penalty_on_overlap():
    problem = problem_of()
    q = draw_postures(problem, "uniform", 50, np.random.default_rng(2))
    judged = problem.measure(q)
    poses = np.repeat(POSE[None], 50, axis=0)
    times = object_escape_time(FIELD, get_object("three_discs").key_points, poses, q)
    np.testing.assert_array_equal(judged.escape_time, times)
    apart = (judged.phi >= 0).all(axis=1)
    assert apart.any() and not apart.all()
    np.testing.assert_array_equal(judged.value[apart], times[apart])
    assert (judged.value[~apart] < times[~apart]).all()


def test_penalty_grows_with_overlap_and_distance_is_free():
    """The paper prints + w sum(phi) in a cost that is minimised, which would reward overlap."""
    values = Postures(np.zeros(4), np.array([[1.0], [0.1], [-0.01], [-0.02]])).value
    np.testing.assert_allclose(
        values, [0.0, 0.0, -0.01 * COLLISION_WEIGHT, -0.02 * COLLISION_WEIGHT]
    )


def test_each_row_may_have_its_own_pose():
    poses = POSE + np.array([[0.0, 0.0, 0.0], [0.05, -0.02, 0.3]])
    q = postures(problem_of(), 2)
    together = problem_of(pose=poses).measure(q)
    for i in range(2):
        alone = problem_of(pose=poses[i]).measure(q[i : i + 1])
        assert alone.value[0] == together.value[i]


def test_bad_problems_are_refused():
    for choice, message in (
        ({"robot": "arm_9"}, "planar_arm"),
        ({"object": "cube"}, "circle"),
        ({"reduce": "min"}, "max"),
    ):
        with pytest.raises(UnknownNameError, match=message):
            CagingProblem(
                **{
                    "robot": "planar_arm",
                    "object": "circle",
                    "pose": POSE,
                    "field": FIELD,
                    **choice,
                }
            )
    with pytest.raises(InvalidParameterError, match=r"less than 1.4 m from the base.*1.500 m"):
        problem_of("circle", pose=[1.5, 0.0, 0.0])
    for pose in ([np.nan, 0.0, 0.0], [0.1, 0.2], "here"):
        with pytest.raises(InvalidStateError, match="object pose"):
            problem_of(pose=pose)
    with pytest.raises(InvalidParameterError, match="leaky wall"):
        problem_of(field=make_field("grid", speed={"leak": 0.0}))
    for q in (np.full((1, 4), np.nan), np.zeros((1, 3)), np.zeros(4)):
        with pytest.raises(InvalidStateError, match="postures"):
            problem_of().measure(q)


# --- the optimisers ----------------------------------------------------------------------------


@pytest.mark.parametrize("optimiser", SMALL)
def test_results_keep_limits_and_constraints_and_follow_from_the_seed(optimiser):
    problem = problem_of()
    search = optimiser(**SMALL[optimiser], restarts=1, guesses=20, kind="curled")
    found, again, other = (search.solve(problem, seed=seed) for seed in (3, 3, 4))
    for name, value in vars(found).items():
        np.testing.assert_array_equal(getattr(again, name), value)
    assert (found.posture != other.posture).any()
    assert found.feasible and min(found.object_distance, found.self_distance) >= -1e-6
    assert (found.posture >= problem.lower).all() and (found.posture <= problem.upper).all()
    assert (
        found.escape_time
        == problem.measure(found.posture[None]).escape_time[0]
        == found.history[-1]
    )
    assert (np.diff(found.history[np.isfinite(found.history)]) >= 0).all()


def test_cma_es_encloses_the_object_and_counts_its_queries():
    hard = make_field("grid", resolution=100, method="marching", speed={"leak": 0.0})
    problem = problem_of()
    found = CmaEsConfiguration(population=40, iterations=30, guesses=50, kind="curled").solve(
        problem
    )
    assert found.queries == 50 + 40 * 30
    assert np.isinf(hard.query(problem.key_points, found.posture)).all()


def test_sqp_encloses_the_object_with_few_queries():
    found = SqpConfiguration(restarts=3).solve(problem_of())
    assert found.feasible and found.escape_time > 70 and found.queries < 500


def test_sqp_never_ends_below_a_feasible_start():
    problem = problem_of()
    q = postures(problem, 40, seed=5)
    for start in q[problem.measure(q).feasible][:3]:
        found = SqpConfiguration(iterations=15).solve(problem, start=start)
        assert found.feasible and found.escape_time >= problem.measure(start[None]).escape_time[0]
        np.testing.assert_array_equal(found.start, start)


def test_sqp_step_satisfies_the_kkt_conditions():
    """The gradient of the quadratic program is held up by its active rows alone, with the right
    signs.
    """
    problem = problem_of()
    sqp = SqpConfiguration(trust=0.2)
    q = postures(problem, 2000, seed=1)
    judged = problem.measure(q)
    checked = 0
    for start in q[judged.feasible & (judged.escape_time > 30)][:5]:
        here = sqp.linearise(problem, start)
        step = sqp.step(problem, here, sqp.trust)
        low = np.maximum(problem.lower - start, -0.2)
        high = np.minimum(problem.upper - start, 0.2)
        slack = np.concatenate([here.phi + here.dphi @ step, step - low, high - step])
        assert slack.min() > -1e-5
        rows = np.vstack([here.dphi, np.eye(4), -np.eye(4)])[slack < 1e-4]  # active
        residual = (np.outer(here.g, here.g) + sqp.regulariser * np.eye(4)) @ step + here.g
        _, distance = nnls(rows.T, residual) if len(rows) else (None, np.linalg.norm(residual))
        assert distance < 1e-3 * (1 + np.linalg.norm(here.g))
        checked += 1
    assert checked == 5


def test_sqp_leaves_an_overlap():
    problem = problem_of("circle", pose=[0.3, 0.04, 0.0])  # half under the first link
    found = SqpConfiguration().solve(problem, start=np.array([0.0, 1.0, 0.5, 0.5]))
    assert problem.measure(found.start[None]).phi.min() < -0.05
    assert found.feasible and np.isneginf(found.history[0])


def test_step_size_follows_the_appendix():
    assert step_size(1.0, 2e-3) == 0.8 and step_size(0.11, 1.0) == 0.1
    assert step_size(0.5, 0.0) == pytest.approx(0.55) and step_size(0.95, -0.1) == 1.0
    assert step_size(0.5, 1e-4) == 0.5


@pytest.mark.parametrize("optimiser", SMALL)
def test_bad_searches_are_refused(optimiser):
    for choice in ({"iterations": 0}, {"restarts": -1}, {"guesses": 2.5}):
        with pytest.raises(InvalidParameterError, match=next(iter(choice))):
            optimiser(**choice)
    with pytest.raises(UnknownNameError, match="curled, left, right, uniform"):
        optimiser(kind="straight")
    with pytest.raises(InvalidStateError, match="joint limits"):
        optimiser().solve(problem_of(), start=[0.0, 3.0, 0.0, 0.0])
    with pytest.raises(InvalidStateError, match="finite"):
        optimiser().solve(problem_of(), start=np.full(4, np.nan))
    for choice in ({"sigma": 0.0}, {"trust": -1.0}):
        if next(iter(choice)) in vars(optimiser()):
            with pytest.raises(InvalidParameterError, match="above 0"):
                optimiser(**choice)
