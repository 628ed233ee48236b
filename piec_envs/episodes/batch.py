"""A batch of episodes: the one implementation behind the single env, the VectorEnv and rollouts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from piec_envs.dynamics.base import Commands, Motion, Plant
from piec_envs.dynamics.quasi_dynamic import QuasiDynamics
from piec_envs.episodes.caging import refresh_escape
from piec_envs.episodes.config import EnvConfig
from piec_envs.episodes.observation import observation_layout, observe_rows
from piec_envs.episodes.rollout import Rollout, join_motions
from piec_envs.episodes.start import StartSampler
from piec_envs.episodes.state import PARAM_KINDS, State, draw_params
from piec_envs.episodes.tasks import MEASURES, measure_rows
from piec_envs.errors import InvalidActionError, InvalidParameterError
from piec_envs.escape.field import CAGING_SCALE
from piec_envs.parallel import run_rows
from piec_envs.world.robots import get_robot
from piec_envs.world.scene import pack_scene

_DISTURBANCE_STREAM = 1  # keeps the disturbance's random numbers apart from the start's


class EpisodeBatch:
    """B episodes of one task, stepped or rolled out together.

    Its present: `state`; `link_distance` (B, links), m; `contact` (B, links); and `measures`
    (B, len(MEASURES)).

    Args:
        config: the environment's keyword arguments.
        rows: B.
    """

    def __init__(self, config: EnvConfig, rows: int):
        self.config = config
        self.task = config.make_task()
        self.robot = get_robot(self.task.robot)
        self.weights = config.cost_weights
        self._prior = config.prior_index
        self.field, self.escape_every = config.make_field()
        self.dynamics = QuasiDynamics(config.solver, config.contact_model, config.threads)
        self.scene = pack_scene(self.robot.name, config.object)
        self.tracking = len(self.task.reference) > 0
        self.observation_size = observation_layout(self.robot, self.tracking)["time"].stop
        self._start = StartSampler(self.robot, self.task, config)
        self.params = config.params  # nominal parameters of the episodes to come
        self.state = State.zeros(rows, self.robot.dof)
        self._adopt_params()
        self.link_distance = np.zeros((rows, self.scene.links))
        self.contact = np.zeros((rows, self.scene.links), dtype=bool)
        self.measures = np.zeros((rows, len(MEASURES)))

    def set_params(self, params: Mapping[str, Any]) -> None:
        """Change plant parameters of the episodes to come.

        Args:
            params: fields of `PlantParams`; the others stay as they are.

        Raises:
            UnknownNameError: for an unknown parameter or name.
            InvalidParameterError: for a value outside its range, or an adversary without a field.
        """
        changed = self.params.replace(params)
        if changed.adversary and self.field is None:
            raise InvalidParameterError("adversary needs an escape field, but escape_field=None")
        self.params = changed

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
        for k, (row, seed) in enumerate(zip(rows, seeds, strict=True)):
            rng = np.random.default_rng(seed)
            params = self.params.replace(draw_params(self.config.randomize or {}, rng))
            if isinstance(given, State):
                params = given.params[min(k, given.rows - 1)]
            params = params.replace(options.get("params") or {})
            self._write(row, self._start.draw(params, seed, rng, given, k))
        self._adopt_params()
        if self.field is not None:  # a given `State` between two refreshes keeps the values it holds
            due = self.state.step[rows] % self.escape_every == 0
            refresh_escape(self.field, self.state, rows[due | (not isinstance(given, State))])
        self._look(rows)

    def restore(self, state: State) -> None:
        """Take over a state of all rows."""
        self.state = state.copy()
        self._adopt_params()
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

    def _adopt_params(self) -> None:
        """Everything that follows from the rows' parameters and seeds."""
        self.params_info = {
            name: np.array(
                [getattr(params, name) for params in self.state.params], dtype=object if kind == "str" else float
            )
            for name, kind in PARAM_KINDS.items()
        }
        self._plant_now = self._plant(self.state)
        self._noise = self._draw_noise(self.state)
        self._flees = self.params_info["adversary"]

    def _plant(self, state: State) -> Plant:
        return Plant(
            self.robot.name,
            [params.object for params in state.params],
            np.array([params.friction for params in state.params]),
        )

    def _draw_noise(self, state: State) -> np.ndarray | None:
        """The whole episode's disturbance, shape (B, horizon, 2), m; None where no row has one."""
        if not any(params.disturbance for params in state.params):
            return None
        noise = np.zeros((state.rows, self.task.horizon, 2))
        for i, (seed, params) in enumerate(zip(state.seed, state.params, strict=True)):
            if params.disturbance:
                rng = np.random.default_rng([int(seed), _DISTURBANCE_STREAM])
                if params.disturbance_kind == "gaussian":
                    noise[i] = params.disturbance * rng.standard_normal((self.task.horizon, 2))
                else:
                    angle = rng.uniform(-np.pi, np.pi, self.task.horizon)
                    noise[i] = params.disturbance * np.column_stack([np.cos(angle), np.sin(angle)])
        return noise

    # --- stepping ----------------------------------------------------------------------------

    def step(self, actions: np.ndarray) -> None:
        """Advance all rows by one step.

        Args:
            actions: shape (B, n), in [-1, 1].

        Raises:
            InvalidActionError: if the actions have the wrong shape or are not finite.
        """
        shape = (self.state.rows, self.robot.dof)
        actions = np.ascontiguousarray(actions, dtype=float)
        if actions.shape != shape:
            raise InvalidActionError(f"actions must have shape {shape}, got {actions.shape}")
        if not np.isfinite(actions).all():
            raise InvalidActionError(f"actions must be finite, got {actions.tolist()}")
        motion, measures = self._advance(self.state, actions[:, None], False, self._plant_now, self._noise, self._flees)
        self.link_distance, self.contact, self.measures = (
            motion.link_distance[:, 1],
            motion.contact[:, 1],
            measures[:, 1],
        )

    def rollout(self, state: State, values: np.ndarray, absolute: bool) -> Rollout:
        """Simulate trajectories from given states, without touching this batch's own episodes.

        Args:
            state: B states at the same step, or one state for all rows of `values`.
            values: actions in [-1, 1], or joint positions to follow, shape (B, N, n).
            absolute: whether `values` are joint positions.

        Returns:
            The trajectories; bit-equal to stepping.
        """
        values = np.ascontiguousarray(values, dtype=float)
        if values.ndim != 3 or values.shape[2] != self.robot.dof or not np.isfinite(values).all():
            raise InvalidActionError(
                f"controls or path must be finite, of shape (rows, steps, {self.robot.dof}), got {values.shape}"
            )
        state = state.take(np.zeros(len(values), dtype=int)) if state.rows == 1 else state.copy()
        plant, noise = self._plant(state), self._draw_noise(state)
        flees = np.array([params.adversary for params in state.params])
        pieces, escape = [self._still(state)], [state.escape_time[:, None].copy()]
        measures = [self._measure_still(pieces[0], state)]
        done, total = 0, values.shape[1]
        while done < total:
            ahead = self.escape_every - int(state.step[0]) % self.escape_every if self.field else total
            chunk = values[:, done : done + ahead]
            motion, measured = self._advance(state, chunk, absolute, plant, noise, flees)
            pieces.append(motion)
            measures.append(measured[:, 1:])
            held = np.repeat(escape[-1][:, -1:], chunk.shape[1], axis=1)  # (B, n)
            held[:, -1] = state.escape_time
            escape.append(held)
            done += chunk.shape[1]
        return Rollout(join_motions(pieces), np.concatenate(measures, axis=1), np.concatenate(escape, axis=1), state)

    def _advance(self, state, values, absolute, plant, noise, flees) -> tuple[Motion, np.ndarray]:
        """Move `state` on by the steps of `values`, which end at the next refresh of the field."""
        steps = values.shape[1]
        displacement = self._displacement(state, steps, noise, flees)
        motion = self.dynamics.rollout(
            state.q_r, state.q_cmd, state.pose, Commands(values, absolute, displacement), plant
        )
        first_step = state.step.copy()
        state.q_r, state.q_cmd = motion.q_r[:, -1].copy(), motion.q_cmd[:, -1].copy()
        state.pose, state.step = motion.pose[:, -1].copy(), state.step + steps
        caging = np.empty((state.rows, steps + 1))
        caging[:] = CAGING_SCALE * state.escape_time[:, None]
        if self.field is not None:
            refresh_escape(self.field, state, np.flatnonzero(state.step % self.escape_every == 0))
            caging[:, -1] = CAGING_SCALE * state.escape_time
        measures = self._measure(motion, first_step, caging)
        if self.tracking:
            for t in range(1, steps + 1):  # one at a time, as stepping does, to be bit-equal to it
                state.error_sum = state.error_sum + measures[:, t, MEASURES.index("tracking_error")]
        return motion, measures

    def _displacement(self, state, steps, noise, flees) -> np.ndarray | None:
        """The object's free displacement in the next steps, shape (B, steps, 2), m."""
        if noise is None and not flees.any():
            return None
        drift = np.where(flees[:, None] > 0, state.drift, 0.0)  # a calm object may still hold an old drift
        displacement = np.repeat(drift[:, None], steps, axis=1)
        if noise is not None:
            when = (state.step[:, None] + np.arange(steps)) % self.task.horizon  # (B, steps)
            displacement = displacement + noise[np.arange(state.rows)[:, None], when]
        return displacement

    # --- what is measured --------------------------------------------------------------------

    def _measure_still(self, motion: Motion, state: State) -> np.ndarray:
        """Measures of a motion without steps, shape (B, 1, len(MEASURES))."""
        return self._measure(motion, state.step, CAGING_SCALE * state.escape_time[:, None])

    def _measure(self, motion: Motion, first_step: np.ndarray, caging: np.ndarray) -> np.ndarray:
        batch, times, _ = motion.pose.shape
        measures = np.empty((batch, times, len(MEASURES)))
        run_rows(
            measure_rows, batch, self._threads(batch * times), self._prior, self.weights,
            self.task.goal, self.task.reference, self.scene.speed_limit, first_step,
            motion.pose, motion.link_distance, motion.actions, caging, measures,
        )  # fmt: skip
        return measures

    def observe(self) -> np.ndarray:
        """Observations of all rows, shape (B, size)."""
        state = self.state
        observation = np.empty((state.rows, self.observation_size))
        run_rows(
            observe_rows, state.rows, 1, (self.scene.lower, self.scene.upper), self.task.goal, self.task.reference,
            self.task.horizon, state.q_r, state.q_cmd, state.pose, state.step, observation,
        )  # fmt: skip
        return observation

    def _threads(self, work: int) -> int | None:
        """Small batches are quicker on one thread."""
        return 1 if work < 4096 else self.config.threads

    def _still(self, state: State) -> Motion:
        """The state as a motion without steps: its distances and contacts."""
        values = np.zeros((state.rows, 0, self.robot.dof))
        return self.dynamics.rollout(state.q_r, state.q_cmd, state.pose, Commands(values), self._plant(state))
