"""Frames: drawn in software on matplotlib's Agg canvas, never pyplot, or in space through MuJoCo
and OpenGL.

`piec_envs/rendering/__init__.pyi` lists the public names; each loads what it needs at its first
use.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
