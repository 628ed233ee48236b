"""The structure that no single module can check: direction of imports, sizes, docstrings."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("piec_envs", "planners", "evaluation")  # each may import those before it
MAX_FILE_LINES = 300
MAX_BODY_LINES = 50

# Inside piec_envs a part may import parts of a lower layer and itself. Modules that stand directly
# in the package and are not named here make up the layer ENV.
# Importable from everywhere.
SHARED = {
    "cache",
    "compilation",
    "console",
    "errors",
    "files",
    "held",
    "kernels",
    "parallel",
    "plain",
    "provenance",
    "sources",
    "versions",
}
LAYERS = {
    "world": 0,
    "geometry": 1,
    "dynamics": 2,
    "escape": 2,
    "model": 3,
    "rendering": 4,
    "wrappers": 6,
    "registration": 7,
}
# TOP: piec_envs/__init__.py, which nothing inside may import
ENV = 5
TOP = 8


def module_name(path: Path) -> str:
    """Dotted name of a source file."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


SOURCES = {
    module_name(path): path
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
}
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in SOURCES.items()}
ALL_FILES = sorted(
    [*SOURCES.values(), *(ROOT / "tests").rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py")]
)


def absolute_base(node: ast.ImportFrom, module: str) -> str:
    """The module that `from X import ...` names, relative dots resolved."""
    if not node.level:
        return node.module or ""
    is_package = SOURCES[module].name == "__init__.py"
    parents = module.split(".")[
        : None if is_package and node.level == 1 else -(node.level - is_package)
    ]
    return ".".join([*parents, *filter(None, [node.module])])


def imports(module: str) -> Iterator[str]:
    """Modules of ours that a module imports, inside functions and for type checking too."""
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = absolute_base(node, module)
            submodules = [f"{base}.{alias.name}" for alias in node.names]
            names = [name if name in SOURCES else base for name in submodules]
        else:
            continue
        yield from (name for name in names if name.split(".")[0] in PACKAGES)


def layer(part: str) -> int:
    """Height of a part of piec_envs; "" is the package itself."""
    return TOP if not part else LAYERS.get(part, ENV)


def part_of(module: str) -> str:
    """Which part of piec_envs a module belongs to: the second component of its name."""
    return module.partition(".")[2].partition(".")[0]


def may_import(importer: str, imported: str) -> bool:
    """Whether the layout allows one of our modules to import another."""
    here, there = (PACKAGES.index(name.split(".")[0]) for name in (importer, imported))
    if here != there:
        return there < here
    if here != 0 or part_of(imported) in SHARED:
        return True
    a = part_of(importer)
    b = part_of(imported)
    if a in SHARED:
        return False
    return a == b or layer(b) < layer(a) or layer(a) == layer(b) == ENV


@pytest.mark.parametrize(
    ("importer", "imported", "allowed"),
    [
        ("evaluation.cli", "planners.cma_es", True),
        ("planners.cma_es", "evaluation.cli", False),
        ("piec_envs.env", "planners.base", False),
        ("planners.base", "piec_envs", True),
        ("piec_envs.geometry.polygon", "piec_envs.world.packed", True),
        ("piec_envs.world.packed", "piec_envs.geometry.polygon", False),
        ("piec_envs.dynamics.protocol", "piec_envs.escape.grid", False),
        ("piec_envs.escape.grid", "piec_envs.dynamics.protocol", False),
        ("piec_envs.escape.grid", "piec_envs.parallel", True),
        ("piec_envs.parallel", "piec_envs.world.packed", False),
        ("piec_envs.env.vector", "piec_envs.model.task", True),
        ("piec_envs.env.single", "piec_envs.wrappers.mismatch", False),
        ("piec_envs.wrappers.mismatch", "piec_envs.env", True),
        ("piec_envs.env", "piec_envs", False),
    ],
)
def test_rules_mean_what_the_layout_says(importer, imported, allowed):
    assert may_import(importer, imported) is allowed


@pytest.mark.parametrize("module", SOURCES)
def test_imports_go_downward(module):
    upward = sorted({name for name in imports(module) if not may_import(module, name)})
    assert not upward, f"{module} must not import {', '.join(upward)}"


def test_no_import_cycles():
    graph = {module: set(imports(module)) - {module} for module in SOURCES}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail("import cycle: " + " <- ".join(error.args[1]))


@pytest.mark.parametrize("path", ALL_FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_files_and_bodies_are_short(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MAX_FILE_LINES
    for function in ast.walk(ast.parse(text)):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            body = (
                function.body[1:]
                if ast.get_docstring(function) and len(function.body) > 1
                else function.body
            )
            lines = (function.end_lineno or 0) - body[0].lineno + 1
            assert lines <= MAX_BODY_LINES, (
                f"{path.name}:{function.lineno} {function.name}: {lines} lines"
            )


def undocumented(node: ast.Module | ast.ClassDef, prefix: str) -> Iterator[str]:
    """Public classes, functions and methods without a docstring, in classes too."""
    for child in node.body:
        if not isinstance(
            child, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
        ) or child.name.startswith("_"):
            continue
        if not ast.get_docstring(child):
            yield f"{prefix}.{child.name}"
        if isinstance(child, ast.ClassDef):
            yield from undocumented(child, f"{prefix}.{child.name}")


@pytest.mark.parametrize("module", SOURCES)
def test_what_is_public_is_documented(module):
    assert ast.get_docstring(TREES[module]), f"{module} says nothing about itself"
    assert not list(undocumented(TREES[module], module))


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_are_typed(package):
    assert (ROOT / package / "py.typed").is_file()
