"""How an episode starts: the drawn start, the user's state, and what is refused."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from piec_envs.dynamics.plant import PlantParams, PlantRows
from piec_envs.errors import InvalidParameterError, InvalidStateError, as_floats, check_name
from piec_envs.geometry.body import scene_distances
from piec_envs.model.setup import Setup
from piec_envs.model.state import State
from piec_envs.world.packed import pack_scene
from piec_envs.world.robots import Robot, get_robot

OPTIONS = ("params", "state")
STATE_FIELDS = ("q_r", "q_cmd", "pose", "step")
ALLOWED_PENETRATION = 1e-3  # m; what the contact models themselves may leave
MOVE_LIMIT = (0.02, 0.3)  # m, rad: how far an overlapping start may be moved
DRAWS = 100


class StartSampler:
    """Draws and checks the starts of episodes.

    Args:
        setup: of the model; a posture of the user's own must be checked by `check_posture`.
    """

    def __init__(self, setup: Setup):
        self.robot: Robot = get_robot(setup.robot)
        self.task = setup.task
        self.posture = setup.posture
        self._noise = setup.start_noise
        self._lower = self.robot.joint_array("lower")
        self._upper = self.robot.joint_array("upper")

    def check_posture(self, name: str) -> None:
        """Refuse joint positions in which no user's state could begin.

        Args:
            name: of the object.

        Raises:
            InvalidParameterError: if they overlap the object where it starts by more than 1 mm.
        """
        pose = self.task.start
        overlap = self._overlap(name, self.posture, pose)
        if overlap > ALLOWED_PENETRATION:
            raise InvalidParameterError(
                f"start={self.posture.tolist()} overlaps the object {name!r} at its start "
                f"{pose.tolist()} by "
                f"{1e3 * overlap:.1f} mm; at most {1e3 * ALLOWED_PENETRATION:g} mm is allowed"
            )

    def check_options(self, options: Mapping[str, Any] | None) -> dict[str, Any]:
        """The options of `reset` as a dict.

        Raises:
            UnknownNameError: for an option that does not exist.
            InvalidStateError: if the given state is neither a `State` nor a mapping.
        """
        for name in options or {}:
            check_name("reset option", name, OPTIONS)
        options = dict(options or {})
        if not isinstance(options.get("state"), State | Mapping | None):
            raise InvalidStateError(
                f"state must be a State or a mapping of its fields, got {options['state']!r}"
            )
        return options

    def draw(
        self,
        params: PlantParams,
        seed: int,
        rng: np.random.Generator,
        given: Mapping[str, Any] | None = None,
    ) -> State:
        """The start of one episode.

        Args:
            params: its plant parameters.
            seed: its episode seed.
            rng: source of randomness for the start's noise.
            given: fields of the user's state; None draws a start.

        Returns:
            A state of one row.

        Raises:
            InvalidStateError: if the given state has the wrong shape, is not finite, breaks the
                joint limits or overlaps the robot by more than 1 mm.
        """
        fresh = State.zeros(1, self.robot.dof)
        fresh.params = PlantRows([params])
        fresh.seed[0] = seed
        fresh.q_r[0] = fresh.q_cmd[0] = self.posture
        if given is None:
            fresh.pose[0] = self._draw_pose(params, rng)
        else:
            self._fill(fresh, given)
            self._check(fresh)
        fresh.start[0] = fresh.pose[0]
        return fresh

    def _fill(self, fresh: State, given: Mapping[str, Any]) -> None:
        fresh.pose[0] = self.task.start
        for name, value in given.items():
            check_name("state field", name, STATE_FIELDS)
            target = getattr(fresh, name)
            value = as_floats(f"state field {name!r}", value, target[0].shape, InvalidStateError)
            if name == "step":
                self._check_step(float(value))
            target[0] = value
        if "q_r" in given and "q_cmd" not in given:
            fresh.q_cmd[0] = fresh.q_r[0]

    def _check_step(self, step: float) -> None:
        if step < 0 or step != int(step):
            raise InvalidStateError(
                f"state field 'step' must be a whole number of at least 0, got {step}"
            )
        if step >= self.task.horizon:
            raise InvalidStateError(
                f"state field 'step' must be below {self.task.horizon}, the end, got {step:g}"
            )
        if step > 0 and len(self.task.reference) > 0:
            raise InvalidStateError(
                "a tracking episode cannot begin at a later step, since its errors so far are "
                "not known; "
                "give a whole State to go on with an episode"
            )

    def _check(self, state: State) -> None:
        state.check(1, self.robot)
        lead = self.robot.joint_array("max_lead")
        for name in ("q_r", "q_cmd"):
            value = getattr(state, name)[0]
            if (value < self._lower - lead).any() or (value > self._upper + lead).any():
                raise InvalidStateError(
                    f"state field {name!r} breaks the joint limits {self._lower.tolist()} to "
                    f"{self._upper.tolist()}: {value.tolist()}"
                )
        overlap = self._overlap(state.params[0].object, state.q_r[0], state.pose[0])
        if overlap > ALLOWED_PENETRATION:
            raise InvalidStateError(
                f"the object overlaps the robot by {1e3 * overlap:.1f} mm at pose "
                f"{state.pose[0].tolist()}; "
                f"at most {1e3 * ALLOWED_PENETRATION:g} mm is allowed"
            )

    def _overlap(self, object_name: str, q: np.ndarray, pose: np.ndarray) -> float:
        """Penetration of object and robot, m; negative where they are apart."""
        scene = pack_scene(self.robot.name, object_name)
        distances = np.empty(scene.robot.links)
        scene_distances(scene, q, pose, distances)
        return -float(distances.min())

    def _draw_pose(self, params: PlantParams, rng: np.random.Generator) -> np.ndarray:
        """The task's start with noise, redrawn while it overlaps the robot."""
        position, angle = self._noise
        bound = np.array([position, position, angle])
        pose = self.task.start.copy()
        for _ in range(DRAWS):
            pose = self.task.start + bound * rng.uniform(-1, 1, 3)
            if self._overlap(params.object, self.posture, pose) <= 0 or not bound.any():
                break
        if self._overlap(params.object, self.posture, pose) > 0:
            pose = self._least_overlap(params.object, pose)
        return pose

    def _least_overlap(self, object_name: str, pose: np.ndarray) -> np.ndarray:
        """The pose of least overlap near `pose`: where the true object is larger than the planned
        one.
        """
        offsets = np.linspace(-1, 1, 9)
        moves = [
            np.array([x, y, 0.0]) * MOVE_LIMIT[0] + np.array([0.0, 0.0, angle]) * MOVE_LIMIT[1]
            for x, y, angle in itertools.product(offsets, repeat=3)
            if x * x + y * y <= 1
        ]
        moves.sort(key=lambda move: float(np.abs(move).sum()))  # of equal overlaps, the least move
        overlaps = [
            max(0.0, self._overlap(object_name, self.posture, pose + move)) for move in moves
        ]
        return pose + moves[int(np.argmin(overlaps))]
