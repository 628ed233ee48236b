"""`piec render`: a plan or an agent as an animation, or a state as a picture."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from evaluation.commands import Report, settings
from evaluation.commands.sources import add_plant_arguments, load_sources
from evaluation.studies import PUSH
from piec_envs import ENVS, InvalidParameterError, check_name, console, files


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "plan", nargs="?", type=Path, help="plan, or agent (.zip); without it a state is drawn"
    )
    parser.add_argument(
        "--env", help="id of the environment (default: the plan's, or PlanarArmPush)"
    )
    parser.add_argument(
        "--state", help="JSON with q_r, pose ..., or a file with it (default: the start)"
    )
    parser.add_argument(
        "--protocol", default="nominal", help="what disturbs the plan (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the episode (default: %(default)s)")
    parser.add_argument(
        "--frames", type=int, default=60, help="of the animation, about (default: %(default)s)"
    )
    parser.add_argument(
        "--fps", type=float, default=15.0, help="frames per second (default: %(default)s)"
    )
    add_plant_arguments(parser)
    parser.add_argument(
        "--out", type=Path, help=".gif, .mp4 or .png (default: beside the plan, or runs/state.png)"
    )


def run(args: argparse.Namespace) -> Report:
    """Draw with the environment's own renderer."""
    return _draw_state(args) if args.plan is None else _draw_plan(args)


def _draw_state(args: argparse.Namespace) -> Report:
    import gymnasium as gym
    import imageio.v3 as imageio

    from evaluation.plants import check_suits
    from evaluation.protocols import get_protocol

    out = args.out or Path("runs/state.png")
    if out.suffix != ".png":
        raise InvalidParameterError(f"a state is drawn as .png, got {out.name!r}")
    env_id = args.env or PUSH
    given = settings(args.set)
    protocol = get_protocol(args.protocol)
    check_name("environment", env_id, ENVS)
    check_suits(protocol, env_id, given)
    env: Any = gym.make(env_id, render_mode="rgb_array", **protocol.env_kwargs(given))
    _, info = env.reset(
        seed=args.seed, options=None if args.state is None else {"state": _state(args.state)}
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    imageio.imwrite(out, env.render())
    shown = {
        name: info[name]
        for name in ("goal_distance", "min_distance", "escape_time", "caging")
        if name in info
    }
    return Report(
        ", ".join(f"{name} {value:.3f}" for name, value in shown.items()), {"info": shown}, [out]
    )


def _state(text: str) -> dict[str, Any]:
    """The state that a JSON text, or a file with one, describes."""
    try:
        path = Path(text)
        value = json.loads(
            text if text.lstrip().startswith("{") else path.read_text(encoding="utf-8")
        )
    except (ValueError, OSError) as error:
        why = (
            files.why_unreadable(text, "JSON object", error)
            if isinstance(error, OSError)
            else error
        )
        raise InvalidParameterError(
            f"--state takes a JSON object or a file with one, got {text!r}: {why}"
        ) from error
    if not isinstance(value, dict):
        raise InvalidParameterError(f"--state takes a JSON object, got {value!r}")
    return value


def _draw_plan(args: argparse.Namespace) -> Report:
    from evaluation.figures.animation import animation
    from evaluation.plants import check_suits, chosen_id, plant_in_force, plant_line
    from evaluation.protocols import get_protocol

    if args.frames < 1 or args.fps <= 0:
        raise InvalidParameterError(
            f"--frames and --fps must be above 0, got {args.frames} and {args.fps}"
        )
    (source,) = load_sources([args.plan])
    protocol = get_protocol(args.protocol)
    env_id = chosen_id(source.made, args.env)
    base = source.base_kwargs(args)
    check_suits(protocol, env_id, base)
    kwargs = protocol.env_kwargs(base)
    plant = plant_in_force(env_id, kwargs)
    end: dict[str, Any] = {}
    out = args.out or args.plan.with_suffix(".gif")
    animation(_frames(source.made, env_id, kwargs, args, end), out, args.fps)
    text = f"{plant_line(plant)}\nthe object ends {end['goal_distance']:.3f} m from the goal"
    return Report(text, {"end": end, "plant": plant}, [out])


def _frames(
    made: Any, env_id: str, kwargs: dict[str, Any], args: argparse.Namespace, end: dict[str, Any]
) -> Iterator[Any]:
    """Pictures of an execution of a plan or an agent; `end` is given its outcome."""
    import gymnasium as gym
    from tqdm import trange

    from evaluation.rollout import check_fit

    env: Any = gym.make(env_id, render_mode="rgb_array", **kwargs)
    policy = made.policy()
    held = None
    check_fit(policy, env_id, env)
    observation, info = env.reset(seed=args.seed)
    every = max(1, made.horizon // args.frames)
    yield env.render()
    for step in trange(
        1, made.horizon + 1, desc="drawing", unit="step", leave=False, disable=console.no_bar()
    ):
        action, held = policy.predict(observation, state=held)
        observation, _, _, _, info = env.step(action)
        if step % every == 0 or step == made.horizon:
            yield env.render()
    end.update({name: info[name] for name in ("goal_distance", "d2g", "is_success")})
