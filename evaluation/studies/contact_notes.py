"""Notes of the tables that compare contact geometries."""

from __future__ import annotations

from collections.abc import Sequence

from evaluation.studies.paper import PAPER_NOTES
from piec_envs import PAPER_PRESETS

CARRY = "rigid-carry"
NOISE_NOTES = """\
n counts distinct executions: plans x rollouts, under `disturbance-5mm` (Gaussian, sigma = 5 mm for
each axis in each step of 0.1 s). First plan: rate of the first planner seed with Wilson's 95 %
interval; each plan: rates of all seeds, their mean with a bootstrap over plans, and the least. d2g:
distance to the goal region at the end, mean ± standard deviation over executions; goal distance: to
its centre. Through itself: plans along which parts of the arm cross."""
MISMATCH_NOTES = """\
d2g, m: distance to the goal region at the end, mean over executions; success: rate of each plan.
From the task's start a plan is one execution; drawn starts lie within 0.01 m and 0.05 rad of it. n
counts distinct executions in each column: plans x executions. The plans are made for friction 0.5,
the study's object and the quasi-dynamic model."""
USAGE_NOTES = """\
n counts distinct executions, one of each plan, without noise. Mean over time, mean ± standard
deviation over plans. Caging, 0.02 T_hat, is that of the parts that can touch the object; whole-arm
caging is what all parts together would give. Arm distance: mean over the links that can touch."""
METHOD_NOTES = """\
Point and Link touch the object with a sphere at the fingertips and with the last link and the
gripper, the others with the whole arm. Each starts from its own solution of the static problem
(study `franka-starts`): the best cage that its contact geometry makes; WAContact, whose prior any
touching posture satisfies, from `open`, elbow and wrist at right angles, which touches and does not
close. Controls change one thing: the start posture, or the contact model, weights and budget
("paper" and "paper-miss", all from a caged start)."""
CARRY_NOTES = """\
Of the controls `rigid-carry` has another planner: it carries the caged start posture to the goal in
a straight line and optimises nothing, so that its plans are one and the same."""


def method_notes(controls: Sequence[str]) -> str:
    """What methods and controls are."""
    known = [METHOD_NOTES]
    if any(name.endswith(PAPER_PRESETS) for name in controls):
        known.append(PAPER_NOTES)
    if CARRY in controls:
        known.append(CARRY_NOTES)
    return "\n\n".join(known)
