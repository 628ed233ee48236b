"""Figures of the studies: they take arrays, write PNG or GIF files and return their paths."""

from evaluation.figures.animation import animate_rollouts
from evaluation.figures.comparison import field_comparison
from evaluation.figures.curves import contact_fractions, distance_bands, final_distances, over_time
from evaluation.figures.fields import RelativeError, error_map
from evaluation.figures.learning import learning_curves, success_matrix
from evaluation.figures.mismatch import Executed, mismatch_paths, shape_mismatches
from evaluation.figures.modes import MODES, Mode
from evaluation.figures.obstacle import ObstaclePanel, escape_times
from evaluation.figures.postures import (
    PosturePanel,
    posture_grid,
    posture_row,
    posture_scenes,
    value_dots,
)
from evaluation.figures.robustness import Robustness, robustness
from evaluation.figures.scenes import keyframes, overview, trajectories
from evaluation.figures.space import space_keyframes
from evaluation.figures.strip import field_strip
from evaluation.figures.tracking import Tracked, reference_paths, tradeoff
from evaluation.figures.trajectory import Trajectory
from evaluation.figures.transfer import transfer_paths

__all__ = [
    "MODES",
    "Executed",
    "Mode",
    "ObstaclePanel",
    "PosturePanel",
    "RelativeError",
    "Robustness",
    "Tracked",
    "Trajectory",
    "animate_rollouts",
    "contact_fractions",
    "distance_bands",
    "error_map",
    "escape_times",
    "field_comparison",
    "field_strip",
    "final_distances",
    "keyframes",
    "learning_curves",
    "mismatch_paths",
    "over_time",
    "overview",
    "posture_grid",
    "posture_row",
    "posture_scenes",
    "reference_paths",
    "robustness",
    "shape_mismatches",
    "space_keyframes",
    "success_matrix",
    "tradeoff",
    "trajectories",
    "transfer_paths",
    "value_dots",
]
