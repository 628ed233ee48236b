"""A batch of episodes: the one implementation behind the single env, the VectorEnv and rollouts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from piec_envs.dynamics.base import Commands, Motion, Plant
from piec_envs.dynamics.table import DynamicsByRow
from piec_envs.episodes.caging import advance_escape, refresh_escape
from piec_envs.episodes.config import EnvConfig
from piec_envs.episodes.disturbance import draw_disturbance, next_displacements
from piec_envs.episodes.observation import observation_layout, observe_rows
from piec_envs.episodes.rollout import Rollout, join_motions
from piec_envs.episodes.start import StartSampler
from piec_envs.episodes.state import PARAM_KINDS, PlantParams, State, draw_params
from piec_envs.episodes.tasks import MEASURES, measure_rows
from piec_envs.errors import InvalidActionError, InvalidParameterError, InvalidStateError, as_floats
from piec_envs.escape.field import CAGING_SCALE
from piec_envs.parallel import run_rows
from piec_envs.world.robots import get_robot
from piec_envs.world.scene import pack_scene

Piece = tuple[Motion, np.ndarray, np.ndarray]  # a motion with its measures and escape times

_COST = MEASURES.index("cost")


class EpisodeBatch:
    """B episodes of one task, stepped or rolled out together.

    Its present: `state`; `link_distance` (B, links), m; `contact` (B, links); and `measures`
    (B, len(MEASURES)); and `stage_cost`, summed over the last action, (B,).

    Args:
        config: the environment's keyword arguments.
        rows: B.
    """

    def __init__(self, config: EnvConfig, rows: int):
        self.config = config
        self.task = config.make_task()
        self.robot = get_robot(config.robot)
        self.weights = config.cost_weights
        self._prior = config.prior_index
        self.field, self.escape_every = config.make_field()
        self.dynamics = DynamicsByRow(config.dynamics_options)
        self.scene = pack_scene(self.robot.name, config.object)
        self.tracking = len(self.task.reference) > 0
        self.observation_size = observation_layout(self.robot, self.tracking)["time"].stop
        self._start = StartSampler(self.robot, self.task, config)
        self.params = config.params  # nominal parameters of the episodes to come
        self.state = State.zeros(rows, self.robot.dof)
        self._noise: np.ndarray | None = None
        self._adopt_params(np.arange(rows))
        self.link_distance = np.zeros((rows, self.scene.links))
        self.contact = np.zeros((rows, self.scene.links), dtype=bool)
        self.measures = np.zeros((rows, len(MEASURES)))
        self.stage_cost = np.zeros(rows)

    def set_params(self, params: Mapping[str, Any]) -> None:
        """Change plant parameters of the episodes to come.

        Args:
            params: fields of `PlantParams`; the others stay as they are.

        Raises:
            UnknownNameError: for an unknown parameter or name.
            InvalidParameterError: for a value outside its range, or an adversary without a field.
        """
        self.params = self._checked(self.params.replace(params))

    # --- reset and restore -------------------------------------------------------------------

    def reset(self, rows: np.ndarray, seeds: list[int], options: Mapping[str, Any] | None = None) -> None:
        """Begin new episodes in some rows.

        Args:
            rows: row numbers.
            seeds: one episode seed for each of these rows; it fixes all of the episode's randomness.
            options: "params" (plant parameters) and "state" (a `State` or its fields).
        """
        options = self._start.check_options(options)
        given = options.get("state")
        if isinstance(given, State):
            given.check(given.rows if given.rows == 1 else self.state.rows, self.robot)
        fresh = [self._fresh(row, seed, options) for row, seed in zip(rows, seeds, strict=True)]
        for row, state in zip(rows, fresh, strict=True):  # nothing is written until all rows are known to be good
            self._write(row, state)
        self._adopt_params(rows)
        if self.field is not None:  # a given `State` between two refreshes keeps the values it holds
            due = self.state.step[rows] % self.escape_every == 0
            refresh_escape(self.field, self.state, rows[due | (not isinstance(given, State))])
        self._look(rows)

    def _fresh(self, row: int, seed: int, options: Mapping[str, Any]) -> State:
        """The start of one row's new episode."""
        given, changes = options.get("state"), options.get("params") or {}
        if isinstance(given, State):
            state = given.take([0 if given.rows == 1 else row])
            state.params = [self._checked(state.params[0].replace(changes))]
            return state
        rng = np.random.default_rng(seed)
        params = self._checked(self.params.replace(draw_params(self.config.randomize or {}, rng), changes))
        state = self._start.draw(params, seed, rng, given)
        state.pose, state.memory = self.dynamics.settle(state.q_r, state.pose, self._plant(state))
        state.start = state.pose.copy()
        return state

    def _checked(self, params: PlantParams) -> PlantParams:
        if params.adversary and self.field is None:
            raise InvalidParameterError("adversary needs an escape field, but escape_field=None")
        return params

    def restore(self, state: State) -> None:
        """Take over a state of all rows.

        Raises:
            InvalidStateError: if its arrays do not fit this batch.
            InvalidParameterError: if its object flees and there is no escape field.
        """
        state.check(self.state.rows, self.robot)
        for params in state.params:
            self._checked(params)
        self.state = state.copy()
        self._adopt_params(np.arange(state.rows))
        self._look(np.arange(state.rows))

    def _look(self, rows: np.ndarray) -> None:
        """Measure the present state of some rows."""
        state = self.state.take(rows)
        motion = self._still(state)
        self.link_distance[rows], self.contact[rows] = motion.link_distance[:, 0], motion.contact[:, 0]
        self.measures[rows] = self._measure_still(motion, state)[:, 0]

    def _write(self, row: int, fresh: State) -> None:
        for name, value in vars(fresh).items():
            getattr(self.state, name)[row] = value[0]

    def _adopt_params(self, rows: np.ndarray) -> None:
        """Everything that follows from the parameters and seeds, of which those of `rows` are new."""
        self.params_info = {
            name: np.array(
                [getattr(params, name) for params in self.state.params], dtype=object if kind == "str" else float
            )
            for name, kind in PARAM_KINDS.items()
        }
        self._plant_now = self._plant(self.state)
        fresh = draw_disturbance(self.state.take(rows), self.task.horizon)
        if len(rows) == self.state.rows:
            self._noise = fresh
        elif fresh is not None or self._noise is not None:
            if self._noise is None:
                self._noise = np.zeros((self.state.rows, self.task.horizon, 2))
            self._noise[rows] = 0.0 if fresh is None else fresh
        self._flees = self.params_info["adversary"]

    def _plant(self, state: State) -> Plant:
        return Plant(
            self.robot.name,
            [params.object for params in state.params],
            np.array([params.friction for params in state.params]),
            [params.dynamics for params in state.params],
            np.array([params.mass for params in state.params]),
            np.array([params.delay for params in state.params]),
            [params.inertia for params in state.params],
        )

    # --- stepping ----------------------------------------------------------------------------

    def step(self, actions: np.ndarray) -> None:
        """Advance all rows by one action, which lasts `action_repeat` steps.

        Args:
            actions: finite, shape (B, n), in [-1, 1]; who takes them from the user checks them.
        """
        values = actions[:, None]
        if self.config.action_repeat > 1:
            values = np.repeat(values, self.config.action_repeat, axis=1)
        pieces = list(self._advances(self.state, values, False, self._plant_now, self._noise, self._flees))
        self.stage_cost = sum(measures[:, 1:, _COST].sum(axis=1) for _, measures, _ in pieces)
        motion, measures, _ = pieces[-1]
        self.link_distance, self.contact, self.measures = (
            motion.link_distance[:, -1],
            motion.contact[:, -1],
            measures[:, -1],
        )

    def rollout(self, state: State, values: np.ndarray, absolute: bool) -> Rollout:
        """Simulate trajectories from given states, without touching this batch's own episodes.

        Args:
            state: B states, or one state for all rows of `values`.
            values: actions in [-1, 1], or joint positions to follow, shape (B, N, n).
            absolute: whether `values` are joint positions.

        Returns:
            The trajectories; bit-equal to stepping.
        """
        values = as_floats("controls or path", values, np.shape(values), InvalidActionError)
        if not isinstance(state, State):
            raise InvalidStateError(f"rollout starts from a State, got {state!r}")
        state.check(state.rows, self.robot)
        if (
            values.ndim != 3
            or state.rows not in (1, len(values))
            or len(values) == 0
            or values.shape[2] != self.robot.dof
        ):
            raise InvalidActionError(
                f"controls or path must be finite, of shape (rows, steps, {self.robot.dof}), with as many rows as "
                f"the state has or any number for a state of one row; got {values.shape} for {state.rows} row(s)"
            )
        state = state.take(np.zeros(len(values), dtype=int)) if state.rows == 1 else state.copy()
        plant, noise = self._plant(state), draw_disturbance(state, self.task.horizon)
        flees = np.array([params.adversary for params in state.params])
        pieces, escape = [self._still(state)], [state.escape_time[:, None].copy()]
        measures = [self._measure_still(pieces[0], state)]
        for motion, measured, times in self._advances(state, values, absolute, plant, noise, flees):
            pieces.append(motion)
            measures.append(measured[:, 1:])
            escape.append(times[:, 1:])
        return Rollout(join_motions(pieces), np.concatenate(measures, axis=1), np.concatenate(escape, axis=1), state)

    def _advances(self, state, values, absolute, plant, noise, flees) -> Iterator[Piece]:
        """Move `state` on by the steps of `values`, in as few pieces of `_advance` as can be."""
        done, total = 0, values.shape[1]
        while done < total:
            # A fleeing object's drift is needed on time; otherwise the field may follow the motion.
            ahead = int((self.escape_every - state.step % self.escape_every).min()) if flees.any() else total
            yield self._advance(state, values[:, done : done + ahead], absolute, plant, noise, flees)
            done += ahead

    def _advance(self, state, values, absolute, plant, noise, flees) -> Piece:
        """Move `state` on by the steps of `values`; a fleeing object's field is refreshed at their end at most.

        Returns:
            The motion, its measures (B, N + 1, len(MEASURES)), and its escape times (B, N + 1), s.
        """
        steps = values.shape[1]
        displacement = next_displacements(state, steps, noise, flees)
        motion = self.dynamics.rollout(
            state.q_r, state.q_cmd, state.pose, Commands(values, absolute, displacement), plant, state.memory
        )
        if np.count_nonzero(state.diverged):  # quicker on one row than any()
            motion.hold(np.flatnonzero(state.diverged), 0)
        first_step = state.step.copy()
        state.q_r, state.q_cmd = motion.q_r[:, -1].copy(), motion.q_cmd[:, -1].copy()
        state.pose, state.step = motion.pose[:, -1].copy(), state.step + steps
        state.memory, state.diverged = motion.memory, motion.diverged[:, -1].copy()
        times = advance_escape(self.field, state, motion, first_step, self.escape_every)
        measures = self._measure(motion, first_step, CAGING_SCALE * times)
        if self.tracking:
            for t in range(1, steps + 1):  # one at a time, as stepping does, to be bit-equal to it
                state.error_sum = state.error_sum + measures[:, t, MEASURES.index("tracking_error")]
        return motion, measures, times

    # --- what is measured --------------------------------------------------------------------

    def _measure_still(self, motion: Motion, state: State) -> np.ndarray:
        """Measures of a motion without steps, shape (B, 1, len(MEASURES))."""
        return self._measure(motion, state.step, CAGING_SCALE * state.escape_time[:, None])

    def _measure(self, motion: Motion, first_step: np.ndarray, caging: np.ndarray) -> np.ndarray:
        batch, times, _ = motion.pose.shape
        measures = np.empty((batch, times, len(MEASURES)))
        run_rows(
            measure_rows, batch, self._threads(batch * times), self._prior, self.weights,
            self.task.goal, self.task.reference, self.task.horizon, self.scene.speed_limit, first_step,
            motion.pose, motion.link_distance, motion.actions, caging, measures,
        )  # fmt: skip
        return measures

    def observe(self) -> np.ndarray:
        """Observations of all rows, shape (B, size)."""
        state = self.state
        observation = np.empty((state.rows, self.observation_size))
        run_rows(
            observe_rows, state.rows, 1, (self.scene.lower, self.scene.upper), self.task.goal, self.task.reference,
            self.task.horizon, self.robot.base_dof, state.q_r, state.q_cmd, state.pose, state.step, observation,
        )  # fmt: skip
        return observation

    def _threads(self, work: int) -> int | None:
        """Small batches are quicker on one thread."""
        return 1 if work < 4096 else self.config.threads

    def _still(self, state: State) -> Motion:
        """The state as a motion without steps: its distances and contacts."""
        values = np.zeros((state.rows, 0, self.robot.dof))
        return self.dynamics.rollout(state.q_r, state.q_cmd, state.pose, Commands(values), self._plant(state))
