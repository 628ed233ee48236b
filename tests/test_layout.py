"""How the source is laid out: one assignment per line outside kernels."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = [
    path
    for package in ("piec_envs", "planners", "evaluation", "benchmarks", "examples", "tests")
    for path in sorted((ROOT / package).rglob("*.py"))
]


def _is_kernel(node):
    """Whether a function is compiled: its decorator is one of piec_envs/kernels.py."""
    decorators = getattr(node, "decorator_list", [])
    return any("kernel" in ast.unparse(decorator) for decorator in decorators)


def _parallel(node):
    """Assignments of several values to several names, such as `a, b = 1, 2`; a swap is one."""
    if _is_kernel(node):
        return
    tuples = isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple)
    if tuples and isinstance(node.targets[0], ast.Tuple):
        yield node
    for child in ast.iter_child_nodes(node):
        yield from _parallel(child)


def _is_swap(node):
    """Whether the values are the targets in another order."""
    targets = {ast.unparse(target) for target in node.targets[0].elts}
    return targets == {ast.unparse(value) for value in node.value.elts}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_one_assignment_per_line(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = [ast.unparse(node) for node in _parallel(tree) if not _is_swap(node)]
    assert not found
