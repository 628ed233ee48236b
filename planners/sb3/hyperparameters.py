"""Hyper-parameters in the format of RL Zoo: the files that ship, and what the algorithms make of
them.
"""

from __future__ import annotations

import ast
import copy
import inspect
from collections.abc import Mapping
from importlib import resources
from typing import Any

from piec_envs import InvalidParameterError, UnknownNameError, check_name
from planners.sb3.algorithms import check_installed, get_algorithm
from planners.sb3.spec import TrainSpec

NAMESPACE = "piec_envs/"
# "lin_3e-4" falls to 0 at the end
SCHEDULED = ("learning_rate", "clip_range", "clip_range_vf", "delta_std")
NORMALISED = ("observation",)  # of the parts of a goal-conditioned observation
# decided by `train`
OWN = ("env", "seed", "verbose", "tensorboard_log", "stats_window_size", "_init_setup_model")


class LinearSchedule:
    """A value that falls to 0 in proportion to what remains of the training; SB3 has had its own
    since 2.7 only.

    Args:
        initial: the value at the start.
    """

    def __init__(self, initial: float):
        self.initial = initial

    def __call__(self, progress_remaining: float) -> float:
        """The value when this share of the training remains."""
        return progress_remaining * self.initial


def _files() -> dict[tuple[str, str], Any]:
    """(id, algorithm) to the file that ships for them, named `<id>.<algorithm>.yml`."""
    folder = resources.files("planners.sb3") / "hyperparameters"
    names = [
        file.name.removesuffix(".yml") for file in folder.iterdir() if file.name.endswith(".yml")
    ]
    pairs = [(NAMESPACE + name.rpartition(".")[0], name.rpartition(".")[2], name) for name in names]
    return {(env_id, algo): folder / f"{name}.yml" for env_id, algo, name in sorted(pairs)}


def read_hyperparameters(env_id: str, algo: str) -> dict[str, Any]:
    """The hyper-parameters that ship for an environment and an algorithm.

    Args:
        env_id: id of the environment.
        algo: row of the table of algorithms.

    Returns:
        The entries of the YAML file, as RL Zoo writes them.

    Raises:
        UnknownNameError: if none ship for them.
        MissingDependencyError: if PyYAML is missing.
    """
    check_installed()
    import yaml

    files = _files()
    if (env_id, algo) not in files:
        known = [f"{known_algo} on {known_id}" for known_id, known_algo in files]
        raise UnknownNameError("hyper-parameters", f"{algo} on {env_id}", known)
    return yaml.safe_load(files[env_id, algo].read_text(encoding="utf-8"))[env_id]


def default_spec(
    env_id: str,
    algo: str,
    seed: int = 0,
    steps: int | None = None,
    env_kwargs: Mapping[str, Any] | None = None,
    hyper: Mapping[str, Any] | None = None,
) -> TrainSpec:
    """The training run with the hyper-parameters that ship.

    Args:
        env_id: id of the environment.
        algo: row of the table of algorithms.
        seed: of all randomness.
        steps: in place of the file's `n_timesteps`.
        env_kwargs: changes to the file's keyword arguments of the environment.
        hyper: changes to the file's other entries, `n_envs` among them.

    Returns:
        The training, the changes applied.

    Raises:
        UnknownNameError: if no hyper-parameters ship for this pair.
        InvalidParameterError: for a bad value.
    """
    found = {**read_hyperparameters(env_id, algo), **(hyper or {})}
    return TrainSpec(
        env_id=env_id,
        algo=algo,
        timesteps=_whole("n_timesteps", found.pop("n_timesteps") if steps is None else steps),
        seed=seed,
        n_envs=_whole("n_envs", found.pop("n_envs", 1)),
        env_kwargs={**found.pop("env_kwargs", {}), **(env_kwargs or {})},
        hyper={name: value for name, value in found.items() if name != "n_timesteps"},
    )


def _whole(name: str, value: Any) -> Any:
    """RL Zoo writes counts as 5e6 too, which YAML reads as a float or as text."""
    try:
        return int(float(value)) if float(value) == int(float(value)) else value
    except (TypeError, ValueError, OverflowError):
        raise InvalidParameterError(f"{name} must be a whole number, got {value!r}") from None


def model_arguments(spec: TrainSpec) -> dict[str, Any]:
    """The arguments of the algorithm's class, in the types it wants; `policy` is among them.

    Raises:
        UnknownNameError: for an argument that the algorithm does not have.
        InvalidParameterError: for text that is no schedule and no literal.
    """
    # A copy, since SB3 writes into `policy_kwargs`, and a spec that changes is another training.
    arguments = {"policy": "MlpPolicy", "device": "cpu", **copy.deepcopy(dict(spec.hyper))}
    arguments.pop("normalize", None)
    known = [
        name for name in inspect.signature(get_algorithm(spec.algo)).parameters if name not in OWN
    ]
    for name, value in arguments.items():
        check_name("hyper-parameter", name, [*known, "normalize"])
        if name in SCHEDULED and isinstance(value, str):
            arguments[name] = _schedule(name, value)
        elif name == "replay_buffer_class":
            arguments[name] = _replay_buffer(value)
        elif name.endswith("_kwargs") and isinstance(value, str):
            arguments[name] = parse(name, value)
        elif name == "train_freq" and isinstance(value, list):
            arguments[name] = tuple(value)
    return arguments


def normalisation_arguments(spec: TrainSpec) -> dict[str, Any] | None:
    """Arguments of SB3's `VecNormalize`, with the discount of the algorithm; None to normalise
    nothing.

    Of a goal-conditioned observation the part "observation" alone is normalised: the goal is the
    same in all episodes, so that the goals that hindsight puts in its place would all be cut to one
    bound or the other.

    Raises:
        InvalidParameterError: for a value that is none of these, or names the goals.
    """
    chosen = spec.hyper.get("normalize", False)
    if isinstance(chosen, str):
        chosen = parse("normalize", chosen)
    if chosen is False or chosen is None:
        return None
    if chosen is not True and not isinstance(chosen, Mapping):
        raise InvalidParameterError(
            f"normalize is true, false or such as dict(norm_obs=False), got {chosen!r}"
        )
    given: dict[str, Any] = {
        "gamma": spec.hyper.get("gamma", 0.99),
        **({} if chosen is True else chosen),
    }
    if spec.env_kwargs.get("goal_conditioned") and given.get("norm_obs", True):
        keys = given.setdefault("norm_obs_keys", list(NORMALISED))
        if not isinstance(keys, list) or set(keys) - set(NORMALISED):
            raise InvalidParameterError(
                f"norm_obs_keys may be {list(NORMALISED)} alone, since goals would be cut to two "
                f"values; got {keys!r}"
            )
    return given


def _schedule(name: str, text: str) -> Any:
    kind, underscore, number = text.rpartition("_")
    try:
        value = float(number)
    except ValueError:
        value = None
    if value is None or kind not in ("", "lin") or (kind == "" and underscore):
        raise InvalidParameterError(f"{name} must be a number, or such as lin_3e-4, got {text!r}")
    return LinearSchedule(value) if kind else value


def _replay_buffer(name: Any) -> Any:
    from stable_baselines3 import HerReplayBuffer

    check_name("replay buffer", name, ("HerReplayBuffer",))
    return HerReplayBuffer


def parse(name: str, text: str) -> Any:
    """The value of text such as "dict(net_arch=[64, 64], activation_fn=nn.Tanh)", which RL Zoo
    would run as code.

    Args:
        name: of the hyper-parameter, for the message.
        text: literals, `dict(...)` of them, and classes of `torch.nn`.

    Returns:
        The value.

    Raises:
        InvalidParameterError: for anything else.
    """
    try:
        return _value(ast.parse(text, mode="eval").body)
    except (SyntaxError, ValueError, AttributeError) as error:
        raise InvalidParameterError(
            f"{name} may hold literals, dict(...) and classes such as nn.Tanh, got {text!r}"
        ) from error


def _value(node: ast.expr) -> Any:
    if (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "dict"
        and not node.args
    ):
        if any(item.arg is None for item in node.keywords):
            raise ValueError("** in dict(...)")
        return {item.arg: _value(item.value) for item in node.keywords}
    if isinstance(node, ast.List | ast.Tuple):
        return [_value(item) for item in node.elts]
    if isinstance(node, ast.Dict):
        names = [ast.literal_eval(name) if name is not None else None for name in node.keys]
        return dict(zip(names, map(_value, node.values), strict=True))
    if (
        isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "nn"
    ):
        from torch import nn

        found = getattr(nn, node.attr)
        if not (isinstance(found, type) and issubclass(found, nn.Module)):
            raise ValueError(f"nn.{node.attr} is no layer")
        return found
    return ast.literal_eval(node)
