"""Any sequence of calls: the native VectorEnv against single environments that are stepped one by
one.
"""

from __future__ import annotations

import copy

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    precondition,
    rule,
    run_state_machine_as_test,
)

from piec_envs.errors import (
    InvalidActionError,
    InvalidParameterError,
    InvalidStateError,
    UnknownNameError,
)

PUSH = "piec_envs/PlanarArmPush-v0"
CAGE = "piec_envs/PlanarArmCage-v0"
ROWS = 2
LIMIT = 6
NOISY = {
    "escape_field": None,
    "object": "square",
    "disturbance": 0.004,
    "start_noise": (0.01, 0.05),
    "randomize": {"friction": [0.1, 0.9]},
}
DRAWN = {**NOISY, "render_mode": "rgb_array"}
FLEEING = {
    **NOISY,
    "escape_field": {"name": "grid", "resolution": 24},
    "escape_every": 4,
    "adversary": 0.5,
}
SECOND_ORDER = {
    **NOISY,
    "randomize": {"dynamics": ["mujoco", "quasi_dynamic"], "friction": [0.1, 0.9]},
}
COARSE = {"escape_field": {"name": "grid", "resolution": 24, "method": "marching"}}
MODES = list(AutoresetMode)
CASES = [
    *[(PUSH, DRAWN if mode == AutoresetMode.NEXT_STEP else NOISY, mode) for mode in MODES],
    (PUSH, FLEEING, AutoresetMode.NEXT_STEP),
    (PUSH, SECOND_ORDER, AutoresetMode.SAME_STEP),
    (PUSH, {**NOISY, "action_repeat": 2, "goal_conditioned": True}, AutoresetMode.NEXT_STEP),
    *[(CAGE, COARSE, mode) for mode in MODES],
]

SEEDS = st.integers(0, 5)
MASKS = (
    st.lists(st.booleans(), min_size=ROWS, max_size=ROWS)
    .filter(any)
    .map(lambda mask: np.array(mask))
)
CHANGES = st.fixed_dictionaries(
    {},
    optional={
        "friction": st.sampled_from([0.0, 0.4]),
        "object": st.sampled_from(["circle", "hexagon"]),
    },
)
STARTS = st.sampled_from([{"pose": [0.6, 0.3, 0.5]}, {"q_r": [-0.3, -0.2, 0.1, 0.0], "step": 997}])
OPTIONS = st.fixed_dictionaries({}, optional={"params": CHANGES, "state": STARTS})
POSES = st.fixed_dictionaries(
    {}, optional={"pose": st.sampled_from([(0.3, 0.1, 0.2), (-0.2, 0.3, 1.0)])}
)


def same(a, b) -> bool:
    """Equal to the last bit, through dicts."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    return np.array_equal(a, b)


def row_of(value, i):
    if isinstance(value, dict):
        return {name: row_of(item, i) for name, item in value.items() if not name.startswith("_")}
    return value[i]


def same_states(a, b) -> bool:
    """Equal to the last bit, row by row: what a row's dynamics remembers differs in length."""
    return all(all(map(np.array_equal, value, getattr(b, name))) for name, value in vars(a).items())


class Calls(RuleBasedStateMachine):
    """A VectorEnv, and beside it for each row a single environment with the count that a limit on
    its steps needs.
    """

    env_id = PUSH
    choice = NOISY
    mode = AutoresetMode.NEXT_STEP

    @initialize()
    def make(self):
        self.motion = self.env_id == PUSH
        limit = {"max_episode_steps": LIMIT} if self.motion else {}
        vector = {"num_envs": ROWS, "autoreset_mode": self.mode, **limit}
        self.envs = gym.make_vec(self.env_id, **vector, **self.choice).unwrapped
        self.singles = [gym.make(self.env_id, **self.choice).unwrapped for _ in range(ROWS)]
        self.begun, self.seeded, self.ended, self.count = np.zeros((4, ROWS), dtype=int)
        self.saved = None

    # --- what both do --------------------------------------------------------------------------

    def begin(self, row, seed=None, options=None):
        """A reset of one single environment."""
        self.begun[row] = 1
        self.ended[row] = 0
        self.count[row] = 0
        self.seeded[row] |= seed is not None
        return self.singles[row].reset(seed=seed, options=copy.deepcopy(options))

    @rule(seed=SEEDS, unseeded=st.booleans(), mask=st.none() | MASKS, options=OPTIONS, pose=POSES)
    def reset(self, seed, unseeded, mask, options, pose):
        options = options if self.motion else pose
        rows = np.flatnonzero(np.ones(ROWS) if mask is None else mask)
        # what the system draws cannot be compared
        seed = None if unseeded and self.seeded[rows].all() else seed
        asked = {**options, **({} if mask is None else {"reset_mask": mask})}
        given = copy.deepcopy(asked)
        observation, info = self.envs.reset(seed=seed, options=asked)
        assert same(asked, given)  # the caller's own dict
        for row in range(ROWS):
            if row in rows:
                one, told = self.begin(row, None if seed is None else seed + row, options)
                assert same(row_of(observation, row), one) and same(row_of(info, row), told)
            assert all(info[name][row] == (row in rows) for name in info if name.startswith("_"))

    @rule(values=st.lists(st.sampled_from([-1.0, -0.3, 0.0, 1.0, 7.0]), min_size=8, max_size=8))
    def step(self, values):
        actions = np.reshape(values, (ROWS, 4))
        if not self.begun.all():
            with pytest.raises(ResetNeeded):
                self.envs.step(actions)
            return
        if self.mode == AutoresetMode.DISABLED and self.ended.any():
            with pytest.raises(InvalidActionError, match="have ended"):
                self.envs.step(actions)
            return
        self.compare(
            self.envs.step(actions), [self.advance(row, actions[row]) for row in range(ROWS)]
        )

    def advance(self, row, action):
        """One step of a single environment and, as the mode has it, the beginning of its next
        episode.
        """
        if self.ended[row]:  # NEXT_STEP: the action is ignored
            return (*self.begin(row), 0.0, False, False, None)
        observation, reward, terminated, truncated, info = self.singles[row].step(action)
        self.count[row] += 1
        truncated |= self.motion and self.count[row] >= LIMIT
        self.ended[row] = terminated or truncated
        final = None
        if self.ended[row] and self.mode == AutoresetMode.SAME_STEP:
            final = observation, info
            observation, info = self.begin(row)
        return observation, info, reward, terminated, truncated, final

    def compare(self, stepped, singles):
        observation, reward, terminated, truncated, info = stepped
        for row, (one, told, value, ends, cut, final) in enumerate(singles):
            own = {name: entry for name, entry in info.items() if "final" not in name}
            assert same(row_of(observation, row), one) and same(row_of(own, row), told)
            assert (reward[row], terminated[row], truncated[row]) == (value, ends, cut)
            if "final_obs" in info:
                assert info["_final_obs"][row] == info["_final_info"][row] == (final is not None)
                assert final is None or same(info["final_obs"][row], final[0])
                assert final is None or same(row_of(info["final_info"], row), final[1])
            else:
                assert final is None

    # --- states and parameters -----------------------------------------------------------------

    @precondition(lambda self: self.motion)
    @rule()
    def get_state(self):
        if not self.begun.all():
            with pytest.raises(ResetNeeded):
                self.envs.get_state()
            return
        self.saved = self.envs.get_state()
        for row, env in enumerate(self.singles):
            alone = env.get_state()
            here = self.saved.take([row])
            assert same_states(alone, here)
            assert same(env.get_params(), row_of(self.envs.get_params(), row))

    @precondition(lambda self: self.motion and self.saved is not None)
    @rule()
    def set_state(self):
        observation, info = self.envs.set_state(self.saved)
        for row, env in enumerate(self.singles):
            one, told = env.set_state(self.saved.take([row]))
            assert same(row_of(observation, row), one) and same(row_of(info, row), told)
            self.begun[row] = 1
            self.count[row] = self.saved.step[row] // env.config.action_repeat
            done = self.saved.diverged[row] or self.saved.step[row] >= 1000
            self.ended[row] = done or self.count[row] >= LIMIT

    @precondition(lambda self: self.motion)
    @rule(changes=CHANGES)
    def set_params(self, changes):
        for env in (self.envs, *self.singles):
            env.set_params(changes)

    # --- what changes nothing ------------------------------------------------------------------

    @rule()
    def refuse(self):
        """Bad input of each kind."""
        state = self.envs.get_state() if self.motion and self.begun.all() else None
        if self.begun.all() and not (self.mode == AutoresetMode.DISABLED and self.ended.any()):
            for actions in (np.zeros((ROWS, 3)), np.full((ROWS, 4), "0.5"), 0.0):
                with pytest.raises(InvalidActionError):
                    self.envs.step(actions)
        with pytest.raises(InvalidParameterError, match="reset_mask"):
            self.envs.reset(seed=3, options={"reset_mask": np.zeros(ROWS, dtype=bool)})
        bad = {"state": {"pose": [50.0, 0.0, 0.0]}} if self.motion else {"pose": (50.0, 0.0, 0.0)}
        for env in (self.envs, *self.singles):
            for options in (bad, {"nothing": 1}):
                for seed in (3, None):
                    with pytest.raises(
                        (InvalidStateError, InvalidParameterError, UnknownNameError)
                    ):
                        env.reset(seed=seed, options=options)
        if state is not None:
            assert same_states(state, self.envs.get_state())

    @rule()
    def render(self):
        for env in (self.envs, *self.singles):
            if not (self.begun.all() if env is self.envs else self.begun[self.singles.index(env)]):
                with pytest.raises(ResetNeeded):
                    env.render()
                continue
            frames = env.render() if env is self.envs else (env.render(),)
            if env.render_mode is None:
                assert frames in (None, (None,))
                continue
            assert all(frame.shape[2] == 3 and frame.dtype == np.uint8 for frame in frames)

    @rule()
    def close(self):
        """Frees what frames were drawn with; a single environment may go on."""
        for env in self.singles:
            env.close()

    def teardown(self):
        if hasattr(self, "envs"):
            self.envs.close()
            self.envs.close()


@pytest.mark.parametrize(("env_id", "choice", "mode"), CASES, ids=str)
def test_any_sequence_of_calls(env_id, choice, mode):
    machine = type("Case", (Calls,), {"env_id": env_id, "choice": choice, "mode": mode})
    run_state_machine_as_test(machine, settings=settings(max_examples=6, stateful_step_count=20))
