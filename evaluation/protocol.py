"""A protocol: under which plant, and from which starts, a policy is evaluated."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

START_NOISE = (0.01, 0.05)  # m, rad

# The true objects of these studies: what each is, and which object plans take it for.
AROUND = {
    "octagon": ("octagon around the circle", "circle"),
    "hexagon": ("hexagon around the circle", "circle"),
    "square": ("square around the circle", "circle"),
    "box_212": ("square box that circle_119 stands for (its sides cut the disc)", "circle_119"),
    "paper_pack_wrapped": ("rounded box around paper_pack", "paper_pack"),
    "a4_box": ("sharp box around paper_pack", "paper_pack"),
}
# that box, and a loose roll at one of four places
ROLLS = [f"a4_box_roll_{k}" for k in range(1, 5)]
TAKEN_FOR = {name: planned for name, (_, planned) in AROUND.items()} | dict.fromkeys(
    ROLLS, "paper_pack"
)


@dataclass(frozen=True)
class Protocol:
    """One row of the table of protocols.

    Args:
        name: its key in the table.
        description: one line for people.
        params: plant parameters in which the plant departs from the env's own.
        start_noise: bounds of the object's start around the task's (m, rad); None keeps the env's
            own.
        randomize: plant parameters that are drawn in each episode; see `EnvConfig`.
    """

    name: str
    description: str
    params: Mapping[str, Any] = field(default_factory=dict)
    start_noise: tuple[float, float] | None = None
    randomize: Mapping[str, Any] = field(default_factory=dict)

    @property
    def unperturbed(self) -> str:
        """Name of the protocol that it is compared with: the same starts, or the task's, and the
        env's own plant.
        """
        return "nominal-start" if self.start_noise == START_NOISE and self.params else "nominal"

    @property
    def with_start(self) -> Protocol:
        """The same plant from starts that are drawn around the task's."""
        position, angle = START_NOISE
        description = (
            f"{self.description}; starts are drawn within {position:g} m and {angle:g} rad"
        )
        return replace(
            self, name=f"{self.name}-start", description=description, start_noise=START_NOISE
        )

    def env_kwargs(self, base: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Keyword arguments of the evaluated env.

        Args:
            base: the user's keyword arguments, which the protocol overrides.

        Returns:
            A new dict.
        """
        noise = {} if self.start_noise is None else {"start_noise": list(self.start_noise)}
        changed = laid_over(base or {}, {**self.params, **noise})
        if self.randomize:
            changed["randomize"] = {**(changed.get("randomize") or {}), **self.randomize}
        return changed

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of the objects that it puts in place of the environment's; none for most."""
        named = [self.params["object"]] if "object" in self.params else []
        return (*named, *self.randomize.get("object", ()))

    def suits(self, objects: Iterable[str]) -> bool:
        """Whether it is about any of these objects, or about whatever the object is.

        Args:
            objects: names in the table of objects.
        """
        families = {family(name) for name in objects}
        return not self.objects or any(family(name) in families for name in self.objects)


def family(name: str) -> str:
    """The object that another one is taken for, such as the circle within a square; else the object
    itself.
    """
    return TAKEN_FOR.get(name, name)


def laid_over(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Keyword arguments with some changed; what is fixed anew is no longer drawn.

    Args:
        base: the keyword arguments.
        changes: those that override them.

    Returns:
        A new dict.
    """
    merged = {**base, **changes}
    drawn = base.get("randomize")
    if "randomize" in changes or not isinstance(drawn, Mapping):
        return merged
    kept = {name: choices for name, choices in drawn.items() if name not in changes}
    del merged["randomize"]
    return {**merged, "randomize": kept} if kept else merged


def is_random(env_kwargs: Mapping[str, Any]) -> bool:
    """Whether episodes of an env with these keyword arguments differ from seed to seed."""
    noise = env_kwargs.get("start_noise") or (0.0, 0.0)
    return bool(env_kwargs.get("disturbance") or any(noise) or env_kwargs.get("randomize"))
