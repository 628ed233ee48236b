"""Whole-arm manipulation environments with an escape-time (caging) field.

Importing this package registers the environments; it loads neither torch nor mujoco.
"""

from piec_envs.registration import register_envs
from piec_envs.shadows import warn_of_shadows

__version__ = "0.1.0"

register_envs()
warn_of_shadows()
