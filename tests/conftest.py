"""Fixtures shared by all tests, how workers share what is costly to make, and which tests
are slow.
"""

from __future__ import annotations

import io
import os
import pickle
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import wraps
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

from piec_envs.errors import MissingDependencyError
from piec_envs.escape import table

# The first call of a kernel compiles; every run draws the same examples.
settings.register_profile("kernels", deadline=None, derandomize=True)
settings.load_profile("kernels")

# Tests that take more than a second once everything is compiled, as the beginnings of their names.
# Modules of this list begin first, in its order, so that no worker is left with a long one at the
# end.
SLOW = (
    "tests/evaluation/test_studies.py::",
    "tests/test_examples.py::",
    "tests/escape/test_rdf_field.py::",
    "tests/evaluation/test_engines.py::",
    "tests/dynamics/test_quasi_dynamic.py::test_fast_equals_osqp",
    "tests/dynamics/test_stress.py::test_a_million_random_actions",
    "tests/dynamics/test_mujoco.py::test_random_actions_hold_the_penetration",
    "tests/planners/test_sb3_checkpoints.py::",
    "tests/evaluation/test_cli.py::test_bench",
    "tests/evaluation/test_cli.py::test_demo",
    "tests/evaluation/test_study_figures.py::test_a_watched_execution_has_its_loose_bodies",
    "tests/escape/test_training.py::",
    "tests/escape/test_targets.py::",
    "tests/escape/test_lower_bound.py::test_key_points_bound_the_escape_time_of_the_body",
    "tests/contracts/test_pickling.py::test_a_copy_of_an_env",
    "tests/contracts/test_env.py::test_check_env[piec_envs/FrankaPush",
    "tests/contracts/test_cage.py::test_the_franka_has_its_geometry_field_and_limits",
    "tests/test_opengl.py::",
    "tests/test_rendering.py::test_an_env_left_open_ends_in_silence",
    "tests/test_kernels.py::",
    "tests/world/test_franka.py::test_without_the_extra_all_else_works_and_the_error_names_it",
    "tests/world/test_franka.py::test_sections_contain_the_meshes",
    "tests/escape/test_table.py::test_it_is_the_grid_of_the_same_robot",
    "tests/planners/test_sb3.py::test_hindsight_replay",
    "tests/planners/test_agent_plants.py::",
    "tests/contracts/test_pickling.py::test_in_another_process",
    "tests/escape/test_network.py::test_asking_needs_no_torch",
    "tests/test_lanes.py::test_what_is_skipped",
    "tests/contracts/test_env.py::test_check_env[piec_envs/MobileFranka",
    "tests/dynamics/test_resting.py::",
    "tests/escape/test_lower_bound.py::test_the_object_time_is_that_bound",
    "tests/evaluation/test_mismatch.py::",
    "tests/evaluation/test_paper.py::test_the_papers_plans_have_a_table",
    "tests/evaluation/test_plant_commands.py::",
    "tests/evaluation/test_plants.py::",
    "tests/evaluation/test_reproduce.py::",
    "tests/evaluation/test_stages.py::test_the_demo",
    "tests/evaluation/test_study_figures.py::",
    "tests/planners/test_sb3_hindsight.py::",
    "tests/planners/test_sb3_training.py::",
    "tests/test_compilation.py::",
    "tests/test_mobile_frames.py::",
    "tests/test_rendering.py::",
    "tests/contracts/test_env.py::test_check_env[piec_envs/FrankaCage",
    "tests/contracts/test_stateful.py::",
    "tests/dynamics/test_mujoco.py::test_distances_and_normals_agree_with_mujoco",
    "tests/dynamics/test_stress.py::",
    "tests/escape/test_lower_bound.py::",
    "tests/escape/test_obstacle.py::test_a_door",
    "tests/evaluation/test_cli.py::test_train_field",
    "tests/evaluation/test_figures.py::",
    "tests/evaluation/test_trajectories.py::",
    "tests/evaluation/test_jobs.py::test_results_do_not_depend",
    "tests/geometry/test_rdf.py::",
    "tests/planners/test_planner.py::",
    "tests/planners/test_sb3.py::",
    "tests/test_hints.py::",
    "tests/test_outside.py::",
)


def pytest_addoption(parser: pytest.Parser) -> None:
    """What `make test-all` asks for."""
    parser.addoption(
        "--no-skips", action="store_true", help="a test or module that is skipped fails"
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the slow tests, and let their modules begin first."""
    modules = list(dict.fromkeys(name.partition("::")[0] for name in SLOW))
    rank = {module: i for i, module in enumerate(modules)}
    for item in items:
        if item.nodeid.startswith(SLOW):
            item.add_marker(pytest.mark.slow)
    items.sort(key=lambda item: rank.get(item.nodeid.partition("::")[0], len(rank)))


def _fail_if_skipped(report: Any, config: pytest.Config) -> None:
    if config.getoption("--no-skips") and report.skipped and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"skipped, which --no-skips forbids: {report.longrepr}"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item):
    """Let a skipped test fail where none may be skipped."""
    report = yield
    _fail_if_skipped(report, item.config)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector):
    """The same of a module that is skipped as a whole."""
    report = yield
    _fail_if_skipped(report, collector.config)
    return report


def _skipped_if_missing(item):
    """A test that needs an optional package which is not installed is skipped."""
    try:
        return (yield)
    except MissingDependencyError as error:
        pytest.skip(str(error))


pytest_runtest_setup = pytest.hookimpl(wrapper=True)(_skipped_if_missing)
pytest_runtest_call = pytest.hookimpl(wrapper=True)(_skipped_if_missing)


# --- what workers share ------------------------------------------------------------------------


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a file that no other process holds; where there are no such locks, hold nothing."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    with open(path, "w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory) -> Path:
    """A folder of this run, the same for all workers of pytest-xdist."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if os.environ.get("PYTEST_XDIST_WORKER") else base


@pytest.fixture(scope="session", autouse=True)
def own_cache(shared_folder):
    """The user's cache is neither read nor written; a table that one worker solves, others wait
    for.
    """
    folder = shared_folder / "solving"
    kept_table = table.kept_table
    folder.mkdir(exist_ok=True)

    def kept_alone(name, digest, shape, make):
        with _alone(folder / digest):
            return kept_table(name, digest, shape, make)

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PIEC_CACHE", str(shared_folder / "cache"))
        patch.setattr(table, "kept_table", kept_alone)
        yield


@pytest.fixture(scope="session", autouse=True)
def compiled_once(shared_folder):
    """What one worker compiles, others wait for and load; without this each would compile
    everything for itself.
    """
    folder = shared_folder / "compiling"
    compile_one = Dispatcher.compile
    folder.mkdir(exist_ok=True)
    held: list[str] = []

    @wraps(compile_one)
    def compile_alone(self, signature):
        function = self.py_func
        name = f"{function.__module__}.{function.__qualname__}-{function.__code__.co_firstlineno}"
        # In this order, that of Numba within itself, so that threads and processes cannot wait for
        # each other.
        with global_compiler_lock, nullcontext() if name in held else _alone(folder / name):
            held.append(name)
            try:
                return compile_one(self, signature)
            finally:
                held.pop()

    with pytest.MonkeyPatch.context() as patch:
        if os.environ.get("PYTEST_XDIST_WORKER"):
            patch.setattr(Dispatcher, "compile", compile_alone)
        yield


# --- what pickles carry --------------------------------------------------------------------------


class _Looking(pickle.Pickler):
    """Notes the compiled functions that it meets: they are pickled by value and compile anew
    elsewhere.
    """

    def __init__(self, file: io.BytesIO):
        super().__init__(file, protocol=5)
        self.compiled: list[str] = []

    def persistent_id(self, obj: Any) -> None:
        """Called for every object on the way."""
        if isinstance(obj, Dispatcher):
            self.compiled.append(obj.py_func.__name__)


def what_is_carried(item: Any) -> tuple[list[str], int]:
    """Names of the compiled functions that a pickle of `item` carries, and its size, bytes."""
    file = io.BytesIO()
    pickler = _Looking(file)
    pickler.dump(item)
    return pickler.compiled, len(file.getvalue())


@pytest.fixture(scope="session")
def carried():
    """The function `what_is_carried`."""
    return what_is_carried
