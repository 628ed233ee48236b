"""OpenGL for frames in space: which backend, what every thread may do with it, and what no fork
may.
"""

from __future__ import annotations

import atexit
import ctypes
import importlib
import os
import sys
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from piec_envs.errors import RenderingError

AFTER_FORK = (
    "renderer='mujoco' cannot draw here: OpenGL was in use in the process that this one was "
    "forked from, and does not "
    "survive a fork; start workers by spawn (AsyncVectorEnv(..., context='spawn'), "
    "multiprocessing.get_context('spawn')), draw nothing before they start, or use "
    "renderer='drawing'"
)
_forked = False  # from a process that had OpenGL in use
_owners: weakref.WeakSet[Any] = weakref.WeakSet()  # of open `Offscreen`s
_used = False  # whether this process has ever opened one


class Offscreen:
    """MuJoCo's renderer of one model, whose OpenGL context belongs to no thread between two frames.

    So frames may be drawn, and the context freed, by any thread, one at a time.

    Args:
        build: makes the model; called once it is sure that frames can be drawn here.
        size: height and width of a frame, pixels.

    Raises:
        RenderingError: where there is no OpenGL, or after a fork.
    """

    def __init__(self, build: Callable[[], Any], size: int):
        global _used
        if _forked:
            raise RenderingError(AFTER_FORK)
        with _explained():
            _choose_backend()
            import mujoco
        self.model = build()
        self.data = mujoco.MjData(self.model)
        with _explained():
            self.renderer = mujoco.Renderer(self.model, size, size)
        _used = True
        _release()
        _close_at_exit()
        _owners.add(self)

    def draw(self) -> Any:
        """The renderer's scene as a picture.

        Raises:
            RenderingError: after a fork.
        """
        if _forked:
            raise RenderingError(AFTER_FORK)
        try:
            return self.renderer.render()
        finally:
            _release()

    def close(self) -> None:
        """Free the context; what a forked process has of it stays as it is."""
        renderer = self.renderer
        self.renderer = None
        _owners.discard(self)
        if renderer is None or _forked:
            return
        try:
            renderer.scene.ngeom = 0
            # makes its context current: closing frees by numbers, which others use too
            renderer.render()
        # another thread holds it, where `_release` cannot: lost is better than others' freed
        except Exception:
            _keep_for_ever(renderer)
            return
        renderer.close()
        _release()


def _release() -> None:
    """Leave no context current in this thread; macOS's own has no such call here."""
    backend = _gl_context().GLContext.__module__.rpartition(".")[2]
    if backend == "egl":
        from mujoco.egl import egl_ext

        egl_ext.eglReleaseThread()
    elif backend == "glfw":
        import glfw

        glfw.make_context_current(None)  # type: ignore[arg-type]
    elif backend == "osmesa":
        from mujoco.osmesa import GL, osmesa

        osmesa.OSMesaMakeCurrent(None, None, GL.GL_FLOAT, 0, 0)


def _gl_context() -> Any:
    """MuJoCo's module that has chosen a backend."""
    return vars(sys.modules[sys.modules["mujoco"].Renderer.__module__])["gl_context"]


@contextmanager
def _explained() -> Iterator[None]:
    """Say what to do where OpenGL fails: each backend does so in its own way, some when
    imported.
    """
    try:
        yield
    except Exception as cause:
        raise RenderingError(
            f"renderer='mujoco' could not open OpenGL with "
            f"MUJOCO_GL={os.environ.get('MUJOCO_GL', '')!r} "
            f"({type(cause).__name__}: {cause}); without a screen set MUJOCO_GL=egl, or "
            f"MUJOCO_GL=osmesa where "
            "libosmesa is installed, before Python starts, or use renderer='drawing'"
        ) from cause


def _choose_backend() -> None:
    """Take EGL where nothing was chosen and there is no screen, even if MuJoCo has been imported
    before.
    """
    screen = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.platform != "linux" or screen or os.environ.get("MUJOCO_GL"):
        return
    os.environ["MUJOCO_GL"] = "egl"
    if "mujoco" in sys.modules:  # it has looked at the variable already, and looks again
        importlib.reload(_gl_context())


@cache
def _close_at_exit() -> None:
    """Close what was left open before EGL ends: to be called once EGL has registered its
    own end.
    """
    atexit.register(_close_all)


def _close_all() -> None:
    for owner in list(_owners):
        owner.close()


def _keep_for_ever(item: Any) -> None:
    """Let nothing free an object, not even the end of the interpreter."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(item))


def _after_fork() -> None:
    """Give up what was opened before: its threads and its connection to the driver are the
    parent's.
    """
    global _forked
    _forked = _forked or _used or _in_use_by_others()
    for owner in list(_owners):
        _keep_for_ever(owner.renderer)
    _owners.clear()
    # it ends EGL at exit, which would wait for threads that are not there
    if "mujoco.egl" in sys.modules:
        atexit.unregister(vars(sys.modules["mujoco.egl"])["EGL"].eglTerminate)


def _in_use_by_others() -> bool:
    """Whether another user of MuJoCo has opened EGL in this process."""
    return getattr(sys.modules.get("mujoco.egl"), "EGL_DISPLAY", None) is not None


if hasattr(os, "register_at_fork"):  # Windows has no forks
    os.register_at_fork(after_in_child=_after_fork)
