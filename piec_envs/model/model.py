"""A task, a robot and contact dynamics as one thing that simulates: what planners plan on and
environments run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.utils import seeding

from piec_envs.dynamics.by_row import DynamicsByRow, DynamicsOptions
from piec_envs.dynamics.plant import PlantParams, PlantRows, draw_params
from piec_envs.dynamics.protocol import Commands, Motion
from piec_envs.errors import InvalidActionError, InvalidParameterError, InvalidStateError, as_floats
from piec_envs.escape.field import CAGING_SCALE
from piec_envs.held import Keeper
from piec_envs.model.disturbance import draw_disturbance, next_displacements
from piec_envs.model.escape_clock import advance_escape, model_field, refresh_escape
from piec_envs.model.kernels import make_yardstick, measure_rows, observe_rows
from piec_envs.model.rollout import Rollout, join_rollouts
from piec_envs.model.setup import Setup
from piec_envs.model.start import StartSampler
from piec_envs.model.state import State, join_states
from piec_envs.model.terms import MEASURE_COLUMNS, MEASURES, observation_layout
from piec_envs.parallel import run_rows
from piec_envs.world.robots import get_robot

SEED_BOUND = 2**63 - 1  # of the episode seeds drawn from a generator
MEASURE_WORK = 0.04  # us of a state, about


class Model:
    """Simulates episodes of one task; holds no episode itself.

    Args:
        setup: what it is made of. `task`, `robot` and `weights` are its own, `field` the escape
            field, or None.

    Raises:
        InvalidParameterError: if something needs an escape field that is not there, or a leaky one,
            or the arm's posture at the start is one that overlaps the object.
    """

    def __init__(self, setup: Setup):
        self.setup = setup
        self.task = setup.task
        self.weights = setup.weights
        self.robot = get_robot(setup.robot)
        self.field = model_field(setup)
        self.dynamics = DynamicsByRow(DynamicsOptions(setup.solver, setup.contact, setup.threads))
        self.layout = observation_layout(self.robot, self.task)
        self._yardstick = Keeper(make_yardstick(setup, self.layout))
        self._start = StartSampler(setup)
        if setup.posture_given:
            self._start.check_posture(setup.plant.object)

    @property
    def home(self) -> np.ndarray:
        """The arm's joint positions at the start, shape (n,), rad or m."""
        return self.setup.posture

    # --- states ------------------------------------------------------------------------------

    def check_params(self, params: PlantParams) -> PlantParams:
        """Refuse plant parameters that need an escape field where there is none.

        Raises:
            InvalidParameterError: for an object that flees.
        """
        if params.adversary and self.field is None:
            raise InvalidParameterError("adversary needs an escape field, but escape_field=None")
        return params

    def reset(self, seed: int) -> State:
        """The state in which `reset(seed=seed)` of the environment begins.

        Args:
            seed: of the environment.

        Returns:
            One row.
        """
        return self.begin([int(seeding.np_random(seed)[0].integers(SEED_BOUND))], self.setup.plant)

    def begin(
        self,
        seeds: Sequence[int],
        nominal: PlantParams,
        options: Mapping[str, Any] | None = None,
        rows: Any = None,
    ) -> State:
        """The starts of episodes.

        Args:
            seeds: one for each; it fixes all of the episode's randomness.
            nominal: plant parameters of which nothing is drawn yet.
            options: "params" (plant parameters) and "state" (a `State` or its fields).
            rows: for each episode its row of a given `State` of several rows; None is their order.

        Returns:
            One row for each seed.

        Raises:
            UnknownNameError: for an option, a parameter or a name that does not exist.
            InvalidParameterError: for a value outside its range.
            InvalidStateError: for a state that none of this model's episodes could be in.
        """
        options = self._start.check_options(options)
        given = options.get("state")
        places = range(len(seeds)) if rows is None else rows
        begun = join_states(
            [
                self._begin_one(int(row), seed, nominal, options)
                for row, seed in zip(places, seeds, strict=True)
            ]
        )
        # a given `State` between two refreshes keeps the values it holds
        if self.field is not None:
            due = (begun.step % self.setup.escape_every == 0) | (not isinstance(given, State))
            refresh_escape(self.field, begun, np.flatnonzero(due))
        return begun

    def _begin_one(
        self, row: int, seed: int, nominal: PlantParams, options: Mapping[str, Any]
    ) -> State:
        """The start of one episode."""
        given = options.get("state")
        changes = options.get("params") or {}
        if isinstance(given, State):
            state = given.take([0 if given.rows == 1 else row])
            state.params = PlantRows([self.check_params(state.params[0].replace(changes))])
            return state
        rng = np.random.default_rng(seed)
        params = self.check_params(nominal.replace(draw_params(self.setup.randomize, rng), changes))
        state = self._start.draw(params, seed, rng, given)
        state.pose, state.memory = self.dynamics.settle(
            state.q_r, state.pose, state.params.plant(self.robot.name)
        )
        state.start = state.pose.copy()
        return state

    def checked(self, state: State, rows: int | None = None) -> State:
        """A state of this model, its own parameters and all.

        Args:
            state: the state.
            rows: how many rows it must have; None takes any number.

        Returns:
            The same.

        Raises:
            InvalidStateError: if its arrays do not fit.
            InvalidParameterError: if its object flees and there is no escape field.
        """
        state.check(state.rows if rows is None else rows, self.robot)
        for row in state.params.fleeing[:1]:
            self.check_params(state.params[row])
        return state

    # --- simulation --------------------------------------------------------------------------

    def draw_disturbance(self, state: State) -> np.ndarray | None:
        """The random displacements of whole episodes, shape (B, horizon, 2), m; None where there
        are none.
        """
        return draw_disturbance(state, self.task.horizon)

    def rollout(self, state: State, values: np.ndarray, absolute: bool = False) -> Rollout:
        """Simulate trajectories from states given by a user.

        Args:
            state: B states, or one state for all rows of `values`.
            values: actions in [-1, 1], or joint positions to follow, shape (B, N, n).
            absolute: whether `values` are joint positions.

        Returns:
            The trajectories; bit-equal to stepping.

        Raises:
            InvalidStateError: if this is no state of the model.
            InvalidActionError: if the values are not finite or their shape does not fit.
        """
        values = as_floats("controls or path", values, np.shape(values), InvalidActionError)
        if not isinstance(state, State):
            raise InvalidStateError(f"rollout starts from a State, got {state!r}")
        state.check(state.rows, self.robot)
        rows = len(values) if values.ndim == 3 else 0
        if rows == 0 or state.rows not in (1, rows) or values.shape[2] != self.robot.dof:
            raise InvalidActionError(
                f"controls or path must be finite, of shape (rows, steps, {self.robot.dof}), "
                f"with as many rows as "
                f"the state has or any number for a state of one row; got {values.shape} for "
                f"{state.rows} row(s)"
            )
        state = state.take(np.zeros(rows, dtype=int)) if state.rows == 1 else state
        return self.simulate(state, values, absolute, self.draw_disturbance(state))

    def simulate(
        self, state: State, values: np.ndarray, absolute: bool, noise: np.ndarray | None
    ) -> Rollout:
        """Simulate trajectories; a step of an environment is the shortest.

        Args:
            state: B states, which stay as they are.
            values: finite, as in `rollout`, shape (B, N, n).
            absolute: whether `values` are joint positions.
            noise: from `draw_disturbance`.

        Returns:
            The trajectories.
        """
        if not len(state.params.fleeing):
            return self._advance(state, values, absolute, noise)
        return join_rollouts(list(self._pieces(state, values, absolute, noise)))

    def measure(self, state: State) -> Rollout:
        """The rollout without steps: distances, contacts and measures of states.

        Args:
            state: B states.
        """
        return self.simulate(state, np.zeros((state.rows, 0, self.robot.dof)), False, None)

    def _pieces(
        self, state: State, values: np.ndarray, absolute: bool, noise: np.ndarray | None
    ) -> Iterator[Rollout]:
        """The steps of `values`, cut where an object that flees needs its drift anew; else the
        field may follow.
        """
        done = 0
        total = values.shape[1]
        every = self.setup.escape_every
        while True:
            ahead = int((every - state.step % every).min())
            piece = self._advance(state, values[:, done : done + ahead], absolute, noise)
            yield piece
            done += ahead
            if done >= total:
                return
            state = piece.final

    def _advance(
        self, state: State, values: np.ndarray, absolute: bool, noise: np.ndarray | None
    ) -> Rollout:
        """The steps of `values`; a fleeing object's field is refreshed at their end at most."""
        displacement = next_displacements(state, values.shape[1], noise)
        motion = self.dynamics.rollout(
            state.q_r, state.q_cmd, state.pose, Commands(values, absolute, displacement),
            state.params.plant(self.robot.name), state.memory,
        )  # fmt: skip
        if np.count_nonzero(state.diverged):  # quicker on one row than any()
            motion.hold(np.flatnonzero(state.diverged), 0)
        final = state.moved(motion)
        times = advance_escape(self.field, final, motion, state.step, self.setup.escape_every)
        measures = self._measures(motion, state.step, CAGING_SCALE * times)
        if self.task.tracks:
            # one at a time, as stepping does, to be bit-equal to it
            for t in range(1, measures.shape[1]):
                final.error_sum = (
                    final.error_sum + measures[:, t, MEASURE_COLUMNS["tracking_error"]]
                )
        return Rollout(motion, measures, times, final)

    def _measures(self, motion: Motion, first_step: np.ndarray, caging: np.ndarray) -> np.ndarray:
        """Measures of every state of a motion, shape (B, N + 1, len(MEASURES))."""
        rows, times, _ = motion.pose.shape
        measures = np.empty((rows, times, len(MEASURES)))
        run_rows(
            measure_rows, rows, self.setup.threads, self._yardstick.held, first_step, motion.pose,
            motion.link_distance, motion.actions, caging, measures,
            work=MEASURE_WORK * rows * times,
        )  # fmt: skip
        return measures

    def observe(self, state: State) -> np.ndarray:
        """Observations of states, shape (B, size).

        Args:
            state: B states.
        """
        observation = np.empty((state.rows, self.layout.size))
        observe_rows(
            0, state.rows, self._yardstick.held,
            state.q_r, state.q_cmd, state.pose, state.step, observation,
        )  # fmt: skip
        for term in self.layout.written:
            values = term.write(state, self.task, self.robot)  # type: ignore[misc]
            observation[:, self.layout.slices[term.name]] = values
        return observation
