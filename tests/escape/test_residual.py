"""The paper's residual loss, and what later work adds to it, against solutions that are known."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from piec_envs.escape import SpeedModel  # noqa: E402
from piec_envs.escape.samples import draw_configurations  # noqa: E402
from piec_envs.escape.training import RECIPES, trainer  # noqa: E402
from piec_envs.escape.training.extended import ExtendedLoss  # noqa: E402
from piec_envs.escape.training.jet import raw_jet  # noqa: E402
from piec_envs.escape.training.recipes import Extended  # noqa: E402
from piec_envs.escape.training.reference import FieldModule  # noqa: E402
from piec_envs.escape.training.residual import Interior, ResidualLoss  # noqa: E402
from piec_envs.escape.weights import input_count  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
ARM = "planar_arm"
R = 1.4
U_BAR = 0.05
SMALL = {"width": 8, "depth": 2, "batch": 32, "configurations": 8, "boundary": 8}


def tiny(name, **changes):
    """A recipe of the table made tiny."""
    return dataclasses.replace(RECIPES[name], **{**SMALL, **changes})


@pytest.fixture
def free_module():
    """A network with which T = T_0."""
    module = FieldModule(input_count(ARM, "skeleton"), 8, 2)
    with torch.no_grad():
        for parameter in module.parameters():
            parameter.zero_()
        module.out.bias.fill_(-100.0)
    return module


FAR = {"clearance": 0.4, "band": 0.8, "batch": 200}
NEAR = {"clearance": 0.031, "band": 0.1, "batch": 200, "near_share": 1.0}


def inner_loss(recipe, module, iteration=0):
    """What a recipe asks for inside the disc, and the points."""
    rng = np.random.default_rng(3)
    q = draw_configurations(ARM, "curled", 8, rng)
    loss = trainer.LOSSES[type(recipe)](recipe, ARM, SpeedModel(), 0, "cpu")
    interior = loss._interior(module, q, rng, iteration)
    return float(loss._inner_loss(module, interior).detach()), loss, interior


def test_the_residual_of_the_free_field_is_zero_far_from_the_robot(free_module):
    recipe = dataclasses.replace(tiny("pinn-factorised"), weight_pde=1.0)
    for scaled, most in ((True, 1e-9), (False, 400e-9)):
        far = dataclasses.replace(recipe, scaled=scaled, **FAR)
        assert inner_loss(far, free_module)[0] < most
    assert inner_loss(dataclasses.replace(recipe, **NEAR), free_module)[0] > 0.01


def extended(**changes):
    """An extended recipe on skeleton inputs, without the residual's part."""
    numbers = {"inputs": "skeleton", "weight_pde": 0.0, "ramp": 0.0, **changes}
    return dataclasses.replace(tiny("pinn-paper-td"), **numbers)


def test_the_temporal_difference_of_the_free_field_is_zero_far_from_the_robot(free_module):
    for time_step in (1.0, 15.0, 100.0):  # with the last, all points stop at the circle
        recipe = extended(time_step=time_step, **FAR)
        found, loss, interior = inner_loss(recipe, free_module)
        ahead, spent, out = loss._ahead(interior)
        assert found < 1e-7
        assert (torch.hypot(*ahead.T) <= R + 1e-5).all() and (spent <= time_step + 1e-5).all()
        assert out.all() if time_step > 50 else not out.all()
    assert inner_loss(extended(**NEAR), free_module)[0] > 1.0


def test_a_temporal_difference_pulls_at_the_point_and_not_at_its_target():
    """Without its own T, which is not differentiated through p', nothing is left of the
    gradient.
    """
    recipe = extended(**NEAR)
    torch.manual_seed(0)
    module = FieldModule(input_count(ARM, "skeleton"), 8, 2)
    _, loss, interior = inner_loss(recipe, module)
    fixed = interior._replace(time=interior.time.detach())
    assert loss._temporal_difference(module, interior).requires_grad
    assert not loss._temporal_difference(module, fixed).requires_grad


def laplacian(slope, p):
    """Divergence of gradients (N, 2) that were taken in the points p (N, 2), shape (N,)."""
    rows = [torch.autograd.grad(slope[:, k].sum(), p, create_graph=True)[0][:, k] for k in (0, 1)]
    return rows[0] + rows[1]


@pytest.mark.parametrize("viscosity", [0.01, 0.1])
def test_the_viscous_equation_holds_for_its_solution_at_the_ridge_too(viscosity):
    """|T'| - eps T'' = 1 on a line of half length 1; as eps falls, T becomes the distance 1
    - |x|.
    """
    x = torch.linspace(-0.9, 0.9, 81, dtype=torch.float64)
    p = torch.stack([x, torch.linspace(0, 1, 81, dtype=torch.float64)], dim=1).requires_grad_()
    away = torch.sqrt(p[:, 0] ** 2 + 1e-300)
    T = 1 - away + viscosity * (np.exp(-1 / viscosity) - torch.exp(-away / viscosity))
    (slope,) = torch.autograd.grad(T.sum(), p, create_graph=True)
    loss = ExtendedLoss(
        tiny("pinn-paper-viscous", viscosity=viscosity), ARM, SpeedModel(), 0, "cpu"
    )
    interior = Interior(p, p, torch.ones_like(x), T, slope, laplacian(slope, p))
    left = loss._left_side(interior).detach().numpy()
    kept = np.abs(x.numpy()) > 1e-9
    np.testing.assert_allclose(left[kept], 1.0, rtol=1e-5)


def test_what_is_carried_forward_equals_what_is_differentiated():
    torch.manual_seed(0)
    module = FieldModule(6, 8, 3).double()
    module.mean.copy_(torch.rand(6))
    module.scale.copy_(0.5 + torch.rand(6))
    p = torch.randn(20, 2, dtype=torch.float64, requires_grad=True)
    q = torch.randn(20, 4, dtype=torch.float64)
    T = torch.nn.functional.softplus(module(torch.cat([p, q], dim=1)))
    (slope,) = torch.autograd.grad(T.sum(), p, create_graph=True)
    expected = (T, slope, laplacian(slope, p))
    for found, true in zip(raw_jet(module, p, q), expected, strict=True):
        torch.testing.assert_close(found, true)
    parameters = list(module.parameters())
    for k, true in enumerate(expected):
        ours, theirs = (
            torch.autograd.grad(
                (part * part).sum(), parameters, retain_graph=True, allow_unused=True
            )
            for part in (raw_jet(module, p, q)[k], true)
        )
        for one, other in zip(ours, theirs, strict=True):
            torch.testing.assert_close(one, torch.zeros_like(one) if other is None else other)


def test_progressive_speed_falls_from_u_bar_to_the_true_one():
    recipe = tiny("pinn-paper-progressive", iterations=100, ramp=0.4)
    loss = ExtendedLoss(recipe, ARM, SpeedModel(), 0, "cpu")
    distance = np.linspace(0.0, 0.5, 50)
    speeds = np.array([loss._speed(distance, iteration) for iteration in range(100)])
    np.testing.assert_allclose(speeds[0], U_BAR)
    assert (np.diff(speeds[:41], axis=0) <= 0).all()
    np.testing.assert_array_equal(speeds[40:], np.tile(SpeedModel().speed(distance), (60, 1)))


def test_without_its_additions_the_extended_loss_is_the_papers():
    paper = tiny("pinn-paper")
    torch.manual_seed(0)
    module = FieldModule(input_count(ARM, "raw"), 8, 2)
    one = ResidualLoss(paper, ARM, SpeedModel(), 0, "cpu")
    other = ExtendedLoss(Extended(**dataclasses.asdict(paper)), ARM, SpeedModel(), 0, "cpu")
    assert [float(one(module, k).detach()) for k in range(3)] == [
        float(other(module, k).detach()) for k in range(3)
    ]


def test_the_additions_differ_from_the_papers_recipe_in_their_number_alone():
    paper = dataclasses.asdict(RECIPES["pinn-paper-short"])
    for name, added in (("viscous", "viscosity"), ("progressive", "ramp"), ("td", "weight_td")):
        row = RECIPES[f"pinn-paper-{name}"]
        plain = dataclasses.replace(row, description=paper["description"], **{added: 0.0})
        assert plain == Extended(**paper) and getattr(row, added) > 0
    assert (
        dataclasses.replace(
            RECIPES["pinn-paper-short"],
            description=RECIPES["pinn-paper"].description,
            iterations=20_000,
        )
        == RECIPES["pinn-paper"]
    )


def test_the_records_say_that_no_addition_makes_the_papers_recipe_learn():
    """As docs/fields.md and the notes of the table put it."""
    lines = (ROOT / "results/field-accuracy/records.jsonl").read_text(encoding="utf-8").splitlines()
    scores = {}
    for record in map(json.loads, lines):
        if record["spec"]["work"] == "score":
            scores[record["spec"]["field"].get("recipe", "T_0")] = record["result"]
    free = scores["T_0"]
    for name in ("short", "viscous", "progressive", "td"):
        found = scores[f"pinn-paper-{name}"]
        assert found["rank_c"] < 0 and found["auc"] < 0.25 and found["cages"] == 0
        assert found["H"]["median"] > 10 * free["H"]["median"]
