"""What runs behind every environment: a batch of episodes, and what it shows of itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces

from piec_envs.env.config import EnvConfig
from piec_envs.env.info import motion_info, single_info
from piec_envs.errors import InvalidParameterError, InvalidStateError
from piec_envs.escape.field import EscapeField
from piec_envs.model.model import Model
from piec_envs.model.rollout import Measured, Rollout
from piec_envs.model.state import State
from piec_envs.model.task import GOAL_RADIUS, REWARD_SCALE
from piec_envs.model.terms import MEASURES, POSITION_BOUND


class Episodes(Protocol):
    """B episodes of one task."""

    rows: int
    config: Any
    observation_space: Any
    action_space: Any

    @property
    def field(self) -> EscapeField | None:
        """The escape field, or None."""
        ...

    @property
    def length(self) -> int | None:
        """Actions of a whole episode; None where the task itself ends it."""
        ...

    def reset(
        self, rows: np.ndarray, seeds: list[int], options: Mapping[str, Any] | None = None
    ) -> None:
        """Begin new episodes in some rows.

        Args:
            rows: row numbers, shape (k,).
            seeds: one episode seed for each of these rows.
            options: what the task lets a reset fix.
        """
        ...

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray]:
        """Advance all rows by one action (B, n), which has been checked; returns observations and
        rewards (B,).
        """
        ...

    def observe(self) -> Any:
        """Observations, as an array or a dict of arrays."""
        ...

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """Which episodes have ended by themselves, and which are cut short whatever their length,
        shape (B,) each.
        """
        ...

    def info(self) -> dict[str, np.ndarray]:
        """Fresh arrays with one entry for each row."""
        ...

    def single_info(self) -> dict[str, Any]:
        """The same of the only row, without the axis of rows."""
        ...

    def frame(self, renderer: Any, row: int, trail: np.ndarray | None) -> np.ndarray:
        """A picture of one row's present.

        Args:
            renderer: a `Renderer`.
            row: which.
            trail: where its object has been, shape (m, 2), m.

        Returns:
            Shape (height, width, 3), uint8.
        """
        ...


class MotionEpisodes:
    """B episodes in which an arm moves an object.

    Args:
        config: the environment's keyword arguments.
        rows: B.
        dtype: of the observations.
    """

    def __init__(self, config: EnvConfig, rows: int, dtype: np.dtype):
        self.config = config
        self.rows = rows
        self.model = Model(config.resolve())
        self.field = self.model.field
        self.params = config.params  # nominal plant parameters of the episodes to come
        self.state = State.zeros(rows, self.model.robot.dof)
        links = len(self.model.robot.links)
        self.measured = Measured(
            np.zeros((rows, links)),
            np.zeros((rows, links), dtype=bool),
            np.zeros((rows, len(MEASURES))),
        )  # of the state
        self._noise: np.ndarray | None = None
        self._dtype = dtype
        self._dense = config.goal_conditioned == "dense"
        self.action_space = spaces.Box(
            -1.0, 1.0, (self.model.robot.dof,), dtype=np.dtype("float64")
        )
        self.observation_space = self._observation_space()
        # others have no such attribute, by which HER would take them for goal-conditioned
        if config.goal_conditioned:
            self.compute_reward = self._compute_reward

    @property
    def length(self) -> int:
        """Actions of an episode: the task's horizon is where time runs out and the cost of its end
        is due.
        """
        return self.model.task.horizon // self.config.action_repeat

    def _observation_space(self) -> spaces.Space:
        bound = self.model.layout.bound.astype(self._dtype)
        flat = spaces.Box(-bound, bound, dtype=self._dtype)
        if not self.config.goal_conditioned:
            return flat
        where = np.full(2, POSITION_BOUND, dtype=self._dtype)
        goal = spaces.Box(-where, where, dtype=self._dtype)
        return spaces.Dict(observation=flat, achieved_goal=goal, desired_goal=goal)

    # --- begin and go on ---------------------------------------------------------------------

    def set_params(self, params: Mapping[str, Any]) -> None:
        """Change plant parameters of the episodes to come.

        Args:
            params: fields of `PlantParams`; the others stay as they are.

        Raises:
            UnknownNameError: for an unknown parameter or name.
            InvalidParameterError: for a value outside its range, or an adversary without a field.
        """
        self.params = self.model.check_params(self.params.replace(params))

    def get_params(self) -> dict[str, np.ndarray]:
        """The plant parameters in force, one entry for each row, and "start", the object's pose,
        shape (B, 3).
        """
        columns = {name: values.copy() for name, values in self.state.params.columns.items()}
        return columns | {"start": self.state.start.copy()}

    def reset(
        self, rows: np.ndarray, seeds: list[int], options: Mapping[str, Any] | None = None
    ) -> None:
        """Begin new episodes in some rows.

        Args:
            rows: row numbers.
            seeds: one episode seed for each of these rows.
            options: "params" (plant parameters) and "state" (a `State` or its fields).
        """
        given = (options or {}).get("state")
        if isinstance(given, State):
            given.check(given.rows if given.rows == 1 else self.rows, self.model.robot)
        # nothing is written until all rows are good
        begun = self.model.begin(seeds, self.params, options, rows)
        self.measured = self.measured.put(rows, self.model.measure(begun).last)
        self.state.put(rows, begun)
        self._redraw(rows)

    def restore(self, state: State) -> None:
        """Take over a state of all rows.

        Raises:
            InvalidStateError: if this is no state, or its arrays do not fit this batch.
            InvalidParameterError: if its object flees and there is no escape field.
        """
        if not isinstance(state, State):
            raise InvalidStateError(f"set_state takes a State, got {state!r}")
        self.state = self.model.checked(state, self.rows).copy()
        self._redraw(np.arange(self.rows))
        self.measured = self.model.measure(self.state).last

    def _redraw(self, rows: np.ndarray) -> None:
        """The displacements of episodes that begin in some rows."""
        fresh = self.model.draw_disturbance(self.state.take(rows))
        if len(rows) == self.rows:
            self._noise = fresh
        elif fresh is not None or self._noise is not None:
            if self._noise is None:
                self._noise = np.zeros((self.rows, self.model.task.horizon, 2))
            self._noise[rows] = 0.0 if fresh is None else fresh

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray]:
        """Advance all rows by one action, which lasts `action_repeat` steps.

        Args:
            actions: finite, shape (B, n), in [-1, 1]; who takes them from the user checks them.

        Returns:
            Observations, and rewards of shape (B,).
        """
        values = actions[:, None]
        if self.config.action_repeat > 1:
            values = np.repeat(values, self.config.action_repeat, axis=1)
        rollout = self.model.simulate(self.state, values, False, self._noise)
        self.state = rollout.final
        self.measured = rollout.last
        observation = self.observe()
        if self.config.goal_conditioned:
            return observation, self._compute_reward(
                observation["achieved_goal"], observation["desired_goal"]
            )
        return observation, -REWARD_SCALE * rollout.cost

    # --- what is shown -----------------------------------------------------------------------

    def observe(self) -> Any:
        """Observations of all rows, as an array or a dict of arrays."""
        flat = self.model.observe(self.state).astype(self._dtype, copy=False)
        if not self.config.goal_conditioned:
            return flat
        place = self.state.pose[:, :2].clip(-POSITION_BOUND, POSITION_BOUND)
        desired = np.repeat(self.model.task.goal[None].astype(self._dtype), len(flat), axis=0)
        return {
            "observation": flat,
            "achieved_goal": place.astype(self._dtype),
            "desired_goal": desired,
        }

    def _compute_reward(
        self, achieved_goal: np.ndarray, desired_goal: np.ndarray, info: Any = None
    ) -> Any:
        """Reward of reaching `achieved_goal` (..., 2) when `desired_goal` (..., 2) was
        asked for.
        """
        offset = np.asarray(achieved_goal, dtype=float) - np.asarray(desired_goal, dtype=float)
        square = offset[..., 0] * offset[..., 0] + offset[..., 1] * offset[..., 1]
        if self._dense:
            reward = -REWARD_SCALE * self.model.weights.task * square
        else:
            reward = -(np.sqrt(square) > GOAL_RADIUS).astype(float)
        return float(reward) if np.ndim(reward) == 0 else reward

    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """None has reached an end of its task; at the horizon, or once diverged, one is truncated,
        shape (B,) each.
        """
        cut = self.state.diverged | (self.state.step >= self.model.task.horizon)
        return np.zeros(self.rows, dtype=bool), cut

    def single_info(self) -> dict[str, Any]:
        """Info of the only row, without the axis of rows."""
        return single_info(
            self.state, self.measured, self.model.task.tracks, self.model.field is not None
        )

    def info(self) -> dict[str, np.ndarray]:
        """Info of all rows at present."""
        return motion_info(
            self.state, self.measured, self.model.task.tracks, self.model.field is not None
        )

    def frame(self, renderer: Any, row: int, trail: np.ndarray | None) -> np.ndarray:
        """A picture of one row's present; see `Episodes.frame`."""
        return renderer.frame(self.model, self.state, self.measured, row, trail)

    def rollout(
        self, state: State, path: np.ndarray | None, controls: np.ndarray | None
    ) -> Rollout:
        """Roll out joint paths or controls; see `MotionInterface.rollout`.

        Raises:
            InvalidParameterError: unless one of the two is given.
        """
        values = path if controls is None else controls
        if values is None or (path is not None and controls is not None):
            raise InvalidParameterError("rollout takes either path or controls")
        return self.model.rollout(state, values, absolute=controls is None)
