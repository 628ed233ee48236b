from __future__ import annotations

import dataclasses
from itertools import count

import gymnasium as gym
import numpy as np
import pytest

import evaluation.rollout
from evaluation import Evaluation, evaluate, summarise
from piec_envs.dynamics.quasi_dynamic import QuasiDynamics
from piec_envs.errors import (
    InvalidActionError,
    InvalidParameterError,
    PlanError,
    RecordError,
    UnknownNameError,
)
from planners import OpenLoopPolicy

PUSH = "piec_envs/PlanarArmPush-v0"
TRACK = "piec_envs/PlanarArmTrack-v0"
NO_FIELD = {"escape_field": None}


def assert_same(a: Evaluation, b: Evaluation) -> None:
    for name, value in vars(a).items():
        if isinstance(value, np.ndarray):
            assert np.array_equal(value, getattr(b, name)), name


def test_rows_do_not_depend_on_the_split_or_the_threads(sweep_plan, monkeypatch):
    policy = OpenLoopPolicy(sweep_plan)
    whole = evaluate(policy, PUSH, "disturbance-5mm", episodes=7, seed=3, env_kwargs=NO_FIELD)
    again = evaluate(
        policy, PUSH, "disturbance-5mm", episodes=7, seed=3, env_kwargs={**NO_FIELD, "threads": 1}
    )
    monkeypatch.setattr(evaluation.rollout, "MAX_ROWS", 3)
    split = evaluate(policy, PUSH, "disturbance-5mm", episodes=7, seed=3, env_kwargs=NO_FIELD)
    assert_same(whole, again)
    assert_same(whole, split)
    assert whole.spec == again.spec == split.spec
    assert whole.episodes == len(whole.distinct) == 7


def test_row_i_is_the_single_env_with_seed_plus_i(sweep_plan):
    policy = OpenLoopPolicy(sweep_plan)
    rows = evaluate(policy, PUSH, "disturbance-3mm", episodes=2, seed=5)
    env = gym.make(PUSH, disturbance=0.003)
    observation, info = env.reset(seed=6)
    assert rows.caging[1, 0] == info["caging"]
    for t in range(1, 201):
        observation, _, _, _, info = env.step(policy.predict(observation)[0])
        assert rows.goal_distance[1, t] == info["goal_distance"]
        assert rows.caging[1, t] == info["caging"]
        assert rows.contact[1, t].tolist() == info["contact_links"].tolist()


def test_a_deterministic_protocol_is_one_execution(sweep_plan):
    nominal = evaluate(OpenLoopPolicy(sweep_plan), PUSH, env_kwargs=NO_FIELD)
    assert nominal.episodes == 1 and nominal.caging is None
    assert nominal.contact_fraction.max() > 0.1
    still = evaluate(
        lambda observation: np.zeros((len(observation), 4)), PUSH, episodes=3, env_kwargs=NO_FIELD
    )
    assert still.episodes == 3
    assert still.distinct.tolist() == [0]
    assert summarise(still)["n"] == 1


def test_a_policy_with_predict_gets_its_state_back():
    class Counter:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            assert deterministic and episode_start.all() == (state is None)
            self.seen = 1 if state is None else state + 1
            return np.zeros((len(observation), 4), dtype=np.float32), self.seen

    policy = Counter()
    evaluate(policy, PUSH, "nominal-start", episodes=2, env_kwargs=NO_FIELD)
    assert policy.seen == 1000


def test_bad_input_is_refused(sweep_plan):
    policy = OpenLoopPolicy(sweep_plan)
    with pytest.raises(UnknownNameError, match=r"known: .*PlanarArmPush"):
        evaluate(policy, "piec_envs/Nowhere-v0")
    with pytest.raises(UnknownNameError, match="protocol"):
        evaluate(policy, PUSH, "storm")
    with pytest.raises(InvalidParameterError, match="episodes"):
        evaluate(policy, PUSH, episodes=0)
    with pytest.raises(InvalidParameterError, match="policy"):
        evaluate(3, PUSH)
    with pytest.raises(PlanError, match="PlanarArmTrack"):
        evaluate(policy, TRACK)
    with pytest.raises(InvalidParameterError, match="escape field"):
        evaluate(policy, PUSH, "adversary", env_kwargs=NO_FIELD)
    with pytest.raises(InvalidActionError, match="shape"):
        evaluate(lambda observation: np.zeros(4), PUSH, episodes=2, env_kwargs=NO_FIELD)


@pytest.mark.parametrize(
    "name", ["num_envs", "max_episode_steps", "autoreset_mode", "action_repeat"]
)
def test_what_evaluate_decides_cannot_be_given(sweep_plan, name):
    """A shorter episode would begin anew within the row and be taken for the end of the first."""
    policy = OpenLoopPolicy(sweep_plan)
    with pytest.raises(InvalidParameterError, match=name):
        evaluate(policy, sweep_plan.env_id, env_kwargs={name: 100})


def test_a_plan_with_other_joints_is_refused(sweep_plan):
    other = OpenLoopPolicy(dataclasses.replace(sweep_plan, joints=("a", "b", "c", "d")))
    with pytest.raises(PlanError, match="joints"):
        evaluate(other, PUSH)


def test_file_round_trip(sweep_plan, tmp_path):
    full = evaluate(
        OpenLoopPolicy(sweep_plan),
        TRACK.replace("Track", "Push"),
        "nominal-start",
        2,
        env_kwargs=NO_FIELD,
    )
    assert_same(full, Evaluation.load(full.save(tmp_path / "full.npz")))
    thin = Evaluation.load(full.save(tmp_path / "thin.npz", every=10))
    assert (thin.every, thin.goal_distance.shape, thin.d2g.shape) == (10, (2, 101), (2,))
    assert thin.spec == full.spec and thin.caging is None
    expanded = thin.expanded()
    assert np.allclose(expanded.pose[:, ::10], full.pose[:, ::10], atol=1e-6)
    assert np.allclose(expanded.q_r, full.q_r, atol=1e-2) and np.allclose(
        expanded.pose, full.pose, atol=5e-3
    )
    assert expanded.contact.dtype == bool and expanded.every == 1
    data = (tmp_path / "thin.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(data[: len(data) // 2])
    (tmp_path / "foreign.npz").write_text("hello")
    for name in ("cut.npz", "foreign.npz", "missing.npz"):
        with pytest.raises(RecordError, match=name):
            Evaluation.load(tmp_path / name)


def diverge(monkeypatch, row: int, step: int) -> None:
    """Make the simulation of one row of the first batch unstable in this step."""
    original = QuasiDynamics.rollout
    times = count(1)

    def rollout(*arguments):
        motion = original(*arguments)
        if motion.actions.shape[1] == 1 and next(times) == step:
            motion.hold(row, 0)
        return motion

    monkeypatch.setattr(QuasiDynamics, "rollout", rollout)


@pytest.mark.parametrize("step", [1, 400, 1000])
def test_a_row_that_diverges_holds_its_last_good_entries_and_fails(sweep_plan, monkeypatch, step):
    def run():
        # starts at the goal
        everywhere = {**NO_FIELD, "goal": [0.55, 0.25]} if step == 1 else NO_FIELD
        return evaluate(
            OpenLoopPolicy(sweep_plan), PUSH, "disturbance-5mm", episodes=3, env_kwargs=everywhere
        )

    whole = run()
    diverge(monkeypatch, row=1, step=step)
    cut = run()
    assert whole.diverged.tolist() == [False] * 3 and summarise(whole)["diverged"] == 0
    assert cut.diverged.tolist() == [False, True, False] and summarise(cut)["diverged"] == 1
    assert not cut.success[1]
    assert cut.d2g[1] == max(0.0, cut.goal_distance[1, step - 1] - 0.05)
    for name in (
        "goal_distance",
        "min_distance",
        "mean_distance",
        "tracking_error",
        "contact",
        "pose",
        "q_r",
    ):
        before = getattr(whole, name)
        after = getattr(cut, name)
        assert np.array_equal(before[[0, 2]], after[[0, 2]]), name
        assert np.array_equal(before[1, :step], after[1, :step]), name
        assert (after[1, step:] == after[1, step - 1]).all(), name


def test_files_from_before_simulations_could_diverge_are_read(sweep_plan, tmp_path):
    seen = evaluate(OpenLoopPolicy(sweep_plan), PUSH, "nominal-start", 2, env_kwargs=NO_FIELD)
    file = dataclasses.replace(seen, diverged=np.array([True, False])).save(tmp_path / "new.npz")
    assert Evaluation.load(file).diverged.tolist() == [True, False]
    with np.load(file) as data:
        np.savez(
            tmp_path / "old.npz", **{name: data[name] for name in data.files if name != "diverged"}
        )
    assert Evaluation.load(tmp_path / "old.npz").diverged.tolist() == [False, False]
