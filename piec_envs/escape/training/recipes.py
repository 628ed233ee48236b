"""The table of recipes: how an escape field is trained, every choice a named number."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, fields
from typing import Any

from piec_envs.errors import InvalidParameterError, as_count, check_name
from piec_envs.escape.perceptron import BLOCK
from piec_envs.escape.weights import INPUTS

SCHEDULES = ("cosine", "halving")


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What all recipes have.

    Args:
        description: one line for people.
        inputs: "skeleton" (geometric features, T = T_0 exp(softplus(z - 3))) or "raw" ((p, q_r),
            T = softplus(z)); see `FieldWeights`.
        width: of the hidden layers.
        depth: number of hidden layers.
        iterations: of Adam, in each round.
        batch: points in each iteration.
        learning_rate: at the start of each round.
        schedule: "cosine" (down to a hundredth within a round) or "halving" (every `halve_every`).
        halve_every: iterations between two halvings.

    Raises:
        UnknownNameError: for an unknown kind of inputs or schedule.
        InvalidParameterError: for a number outside its range.
    """

    description: str = ""
    inputs: str = "skeleton"
    width: int = 64
    depth: int = 2
    iterations: int = 20_000
    batch: int = 4096
    learning_rate: float = 3e-3
    schedule: str = "cosine"
    halve_every: int = 2000

    def __post_init__(self):
        check_name("kind of inputs", self.inputs, INPUTS)
        check_name("schedule", self.schedule, SCHEDULES)
        if self.width % BLOCK:
            raise InvalidParameterError(f"width must be a multiple of {BLOCK}, got {self.width}")
        for item in fields(self):
            value = getattr(self, item.name)
            if type(item.default) is int:
                as_count(item.name, value, 0 if item.name == "rounds" else 1)
            elif isinstance(item.default, float) and not (math.isfinite(value) and value >= 0):
                raise InvalidParameterError(
                    f"{item.name} must be finite and not negative, got {value}"
                )

    def described(self) -> dict[str, Any]:
        """The recipe as JSON values, with the name of its method."""
        return json.loads(json.dumps({"method": type(self).__name__, **asdict(self)}))


@dataclass(frozen=True, kw_only=True)
class Fitted(Recipe):
    """A recipe that regresses log(T / T_0) on targets, with a Huber loss.

    Args:
        configurations: in the training set of each round: uniform, curled and closing, a third
            each.
        points: for each configuration: half around the arm, a quarter close to it, a quarter
            anywhere.
        huber: error of log(T / T_0) at which the loss turns from quadratic to linear.
    """

    configurations: int = 40_000
    points: int = 150
    huber: float = 0.02


@dataclass(frozen=True, kw_only=True)
class Labelled(Fitted):
    """Regression on labels of the grid solver.

    Args:
        resolution: of the second-order grid that gives the labels.
    """

    resolution: int = 200


@dataclass(frozen=True, kw_only=True)
class Bellman(Fitted):
    """Fitted Bellman iteration, without any solver's label.

    Round 0 regresses on the time of the best straight line out, an upper bound. Each further round
    looks ahead from every point with the network of the round before,

        T(p) = min over directions e and lengths r of  integral of ds/u along p + s e, s <= r, + T(p
        + r e),

    and then takes the true time of going on from there, along -grad T or straight out, or that of
    following -grad T from p. With `descent_step` above 0 every target is the time of a path that
    can be gone and bounds T from above, so that no error of the network can pull it below the least
    time, the viscosity solution.

    Args:
        configurations, points, iterations: as in `Fitted`, fewer by default.
        rounds: after round 0.
        directions: that a look ahead tries, evenly spaced from a random one.
        lengths: of its straight lines, m.
        first_directions: that a straight line out tries.
        line_step: longest step of the integral along a straight line, m.
        descent_step: of following -grad T, m; 0 takes the network's T(p + r e) instead.
        descent_steps: at most; a descent that is not out by then counts as endless.
        last_factor: by how much longer the last round is.
    """

    configurations: int = 2500
    points: int = 40
    iterations: int = 1500
    rounds: int = 4
    directions: int = 32
    lengths: tuple[float, ...] = (0.05, 0.1, 0.2, 0.4, 0.8)
    first_directions: int = 64
    line_step: float = 0.025
    descent_step: float = 0.03
    descent_steps: int = 150
    last_factor: int = 4

    def __post_init__(self):
        super().__post_init__()
        if not self.line_step > 0:
            raise InvalidParameterError(f"line_step must be above 0, got {self.line_step}")
        if not self.lengths or not all(
            a < b < math.inf for a, b in zip((0.0, *self.lengths), self.lengths, strict=False)
        ):
            raise InvalidParameterError(f"lengths must increase and be above 0, got {self.lengths}")


@dataclass(frozen=True, kw_only=True)
class Residual(Recipe):
    """The paper's physics-informed loss (section 4.3, appendix A.1.1), without labels.

    Args:
        weight_pde: lambda of the eikonal residual.
        weight_bc: lambda of the boundary loss.
        scaled: take the residual times u, so that slow regions do not drown the others.
        configurations: in each iteration, uniform within the limits.
        near_share: share of the points that lie in the band around the robot.
        band: outer distance of that band, m.
        clearance: least distance of all points to the robot, m: above d0, within which 1/u is that
            of the wall (the paper's 0.01 lies inside, where its 1/u is infinite).
        boundary: points on the circle in each iteration.
    """

    weight_pde: float = 10.0
    weight_bc: float = 1.0
    scaled: bool = False
    configurations: int = 128
    near_share: float = 0.99
    band: float = 0.1
    clearance: float = 0.031
    boundary: int = 128

    def __post_init__(self):
        super().__post_init__()
        if self.clearance >= self.band:
            raise InvalidParameterError(
                f"band must be above clearance, {self.clearance}, got {self.band}"
            )


@dataclass(frozen=True, kw_only=True)
class Extended(Residual):
    """The paper's loss with what later work adds to it; the numbers are ours where none is named.

    Args:
        viscosity: eps of the term -eps Laplacian(T) in the residual, m, with which the time of
            least arrival is the only limit as eps goes to 0 (P-NTFields: Ni and Qureshi,
            "Progressive learning for physics-informed neural motion planning", RSS 2023, eq. 6, eps
            0.01 in a unit cube).
        ramp: share of the iterations in which the speed falls from u_bar everywhere to u, linearly
            (the same, eq. 8: (1 - a) u_bar + a u, a from 0 to 1).
        weight_td: lambda of the temporal difference, 1/s^2 (NTRL: Ni, Pan and Qureshi,
            "Physics-informed temporal difference metric learning for robot motion planning", ICLR
            2025).
        time_step: between a point and the one that it is held against, s: in free space 1 s is 0.05
            m, as theirs is 0.02 of a unit cube.
    """

    viscosity: float = 0.0
    ramp: float = 0.0
    weight_td: float = 0.0
    time_step: float = 1.0

    def __post_init__(self):
        super().__post_init__()
        if self.viscosity and self.inputs != "raw":
            raise InvalidParameterError(f"viscosity needs raw inputs, got {self.inputs!r}")
        if self.ramp > 1:
            raise InvalidParameterError(f"ramp must be at most 1, got {self.ramp}")
        if not self.time_step > 0:
            raise InvalidParameterError(f"time_step must be above 0, got {self.time_step}")


# The paper's network and optimiser (appendix A.1.1).
_PAPER: dict[str, Any] = {
    "inputs": "raw",
    "width": 256,
    "depth": 6,
    "batch": 1024,
    "learning_rate": 1e-3,
    "schedule": "halving",
}
_SHORT = 2500  # iterations, an eighth of the paper's 20,000


def _with_addition(what: str, **numbers: Any) -> Extended:
    """The paper's recipe, an eighth as long, with one of the additions."""
    return Extended(
        description=f"the paper's, an eighth as long, with {what}",
        iterations=_SHORT,
        **numbers,
        **_PAPER,
    )


RECIPES: dict[str, Recipe] = {
    "network": Labelled(description="labels of the second-order grid", iterations=40_000),
    "pinn": Bellman(
        description="label-free: Bellman look-ahead and descent",
    ),
    "pinn-paper": Residual(
        description="the paper's recipe to the letter",
        iterations=20_000,
        **_PAPER,
    ),
    "pinn-paper-short": Residual(
        description="the first eighth of the paper's training",
        iterations=_SHORT,
        **_PAPER,
    ),
    "pinn-paper-viscous": _with_addition("a viscosity term", viscosity=0.01),
    "pinn-paper-progressive": _with_addition("progressive speed", ramp=0.5),
    "pinn-paper-td": _with_addition("a temporal difference", weight_td=10.0),
    "pinn-factorised": Residual(
        description="label-free: scaled residual, T = T_0 exp(.), geometric features",
        iterations=5000,
        batch=1024,
        scaled=True,
        near_share=0.5,
        band=0.4,
    ),
    "pinn-lines": Bellman(
        description="label-free: the best straight line out, no look-ahead",
        rounds=0,
    ),
    "pinn-values": Bellman(
        description="label-free: Bellman look-ahead on the network's own values, no descent",
        descent_step=0.0,
    ),
    "pinn-local": Bellman(
        description="label-free: the same, with a look-ahead of one short step",
        lengths=(0.05,),
        descent_step=0.0,
    ),
}


def get_recipe(name: str) -> Recipe:
    """The recipe of that name.

    Raises:
        UnknownNameError: if the table has no such row.
    """
    check_name("recipe", name, RECIPES)
    return RECIPES[name]
