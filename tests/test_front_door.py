"""What is public: `piec_envs.__all__`, from which planners, evaluation, examples and docs take
everything.
"""

from __future__ import annotations

import ast
import inspect
import pickle
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import piec_envs
from piec_envs import errors

ROOT = Path(__file__).resolve().parents[1]
USERS = sorted(
    path for package in ("planners", "evaluation") for path in (ROOT / package).rglob("*.py")
)
INNER = "rdf_accuracy.py"  # measures the fit of the robot distance field, which is not public
SCRIPTS = [
    path
    for folder in ("examples", "benchmarks")
    for path in sorted((ROOT / folder).glob("*.py"))
    if path.name != INNER
]
DOCS = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
HEAVY = ("matplotlib", "mujoco", "numba", "scipy", "torch")
NAMESPACES = {
    name for name in piec_envs.__all__ if isinstance(getattr(piec_envs, name), ModuleType)
}
OWN = re.compile(r"piec_envs(?:\.\w+)+")


def short(path: Path) -> str:
    return str(path.relative_to(ROOT))


def is_public(dotted: str) -> bool:
    """Whether "piec_envs.NAME", or a name in one of its namespaces, is on the list."""
    _, name, *rest = dotted.split(".")
    if name not in piec_envs.__all__:
        return name == "__version__"
    return name not in NAMESPACES or not rest or rest[0] in getattr(piec_envs, name).__all__


def named(tree: ast.AST) -> Iterator[str]:
    """Everything of piec_envs that code names: by imports, as an attribute, and as text."""
    spaces = {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "piec_envs"
        for alias in node.names
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and not node.level and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            home = "piec_envs." if node.value.id in spaces & NAMESPACES else ""
            yield f"{home}{node.value.id}.{node.attr}"
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from OWN.findall(node.value)


def internal(tree: ast.AST) -> set[str]:
    return {name for name in named(tree) if OWN.fullmatch(name) and not is_public(name)}


@pytest.mark.parametrize("name", piec_envs.__all__)
def test_a_public_name_is_there_and_says_what_it_is(name):
    value = getattr(piec_envs, name)
    assert name in dir(piec_envs)
    if inspect.isroutine(value) or inspect.isclass(value) or isinstance(value, ModuleType):
        assert inspect.getdoc(value)
    if inspect.isclass(value):
        assert pickle.loads(pickle.dumps(value)) is value


@pytest.mark.parametrize("space", sorted(NAMESPACES))
def test_a_namespace_lists_its_own_names(space):
    module = getattr(piec_envs, space)
    for name in module.__all__:
        value = getattr(module, name)
        assert name in dir(module)
        assert not callable(value) or inspect.getdoc(value)


@pytest.mark.parametrize("package", ["piec_envs", "piec_envs/rendering"])
def test_no_public_name_is_hidden_by_a_module(package):
    """Python puts a module that is imported into its package, in place of anything of the same
    name.
    """
    folder = ROOT / package
    listed = (piec_envs if package == "piec_envs" else piec_envs.rendering).__all__
    inside = {path.stem for path in folder.glob("*.py")} | {
        path.parent.name for path in folder.glob("*/__init__.py")
    }
    assert inside & {*listed} == (NAMESPACES if package == "piec_envs" else set())


def test_no_name_is_listed_twice():
    for stub in ROOT.glob("piec_envs/**/__init__.pyi"):
        names = re.findall(r" as (\w+)$", stub.read_text(encoding="utf-8"), re.MULTILINE)
        assert len(names) == len(set(names))


def test_every_error_is_public():
    for name, value in vars(errors).items():
        if inspect.isclass(value) and issubclass(value, errors.PiecError):
            assert getattr(piec_envs, name) is value


@pytest.mark.parametrize("path", USERS, ids=short)
def test_planners_and_evaluation_import_piec_envs_itself_alone(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            assert not (node.module or "").startswith("piec_envs.")
        elif isinstance(node, ast.Import):
            assert not [alias.name for alias in node.names if alias.name.startswith("piec_envs.")]
    assert not internal(tree)


@pytest.mark.parametrize("path", SCRIPTS, ids=short)
def test_examples_and_benchmarks_use_public_names(path):
    assert not internal(ast.parse(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize("path", DOCS, ids=short)
def test_docs_name_what_is_public(path):
    text = path.read_text(encoding="utf-8")
    assert not {name for name in OWN.findall(text) if not is_public(name)}
    lines = re.findall(r"^.*\bfrom piec_envs[\w.]* import .*$", text, re.MULTILINE)
    for line in lines:
        statement = re.search(r"from (piec_envs[\w.]*) import (\w+(?:, \w+)*)", line)
        assert statement, f"write {line!r} in one line"
        taken = [f"{statement[1]}.{name}" for name in statement[2].split(", ")]
        assert not [name for name in taken if not is_public(name)]


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("from piec_envs import get_robot, rendering\nrendering.draw_robot", set()),
        ("from piec_envs.wrappers import FrictionMismatch", set()),
        ("import piec_envs\npiec_envs.get_robot('franka')", set()),
        ("import piec_envs.kernels", {"piec_envs.kernels"}),
        ("from piec_envs import kernels", {"piec_envs.kernels"}),
        ("from piec_envs.rendering.drawing import INK", {"piec_envs.rendering.drawing.INK"}),
        ("from piec_envs import rendering\nrendering.drawing", {"piec_envs.rendering.drawing"}),
        ("def f():\n    import piec_envs\n    piec_envs.parallel.run_rows", {"piec_envs.parallel"}),
        ("import_module('piec_envs.episodes.batch')", {"piec_envs.episodes.batch"}),
    ],
)
def test_what_is_internal_is_noticed(code, found):
    assert internal(ast.parse(code)) == found


def test_importing_loads_nothing_heavy():
    code = f"import sys, piec_envs; print(*sorted({{*{HEAVY}}} & {{*sys.modules}}))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert not done.stdout.split()


def test_an_unknown_name_is_refused():
    with pytest.raises(AttributeError, match="get_robots"):
        piec_envs.get_robots  # noqa: B018
    with pytest.raises(ImportError, match="get_robots"):
        exec("from piec_envs import get_robots")
