"""Whole-arm manipulation environments with an escape-time (caging) field.

Importing this package registers the environments. `piec_envs/__init__.pyi` lists its public names;
each loads what it needs at its first use, so that neither numba, torch nor mujoco is loaded before.
"""

import lazy_loader

from piec_envs.env.registry import register_envs
from piec_envs.shadows import warn_of_shadows

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

register_envs()
warn_of_shadows()
