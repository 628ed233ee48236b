"""What a kept table is found by: a digest of all that decides its numbers, the code that computes them included."""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

CODE = "piec_envs.escape.tabulation"  # what computes tables; it reaches all other modules that have a part in it
# Reached too, but no number comes from them, nor from what they alone reach.
NO_PART = frozenset(f"piec_envs.{name}" for name in ("compilation", "console", "errors", "parallel"))


def table_key(*inputs: Any) -> str:
    """Digest of what a table is computed from and of the code that computes it.

    Comments, docstrings and layout of the code have no part in it.

    Args:
        inputs: numbers, arrays, and tuples of them.

    Returns:
        SHA-256, in hexadecimal digits.
    """
    digest = hashlib.sha256(f"{code_digest()} {sys.byteorder}".encode())
    for item in _leaves(inputs):
        array = np.asarray(item, dtype=float) + 0.0  # which leaves no negative zeros
        digest.update(f" {array.shape} ".encode() + array.tobytes())
    return digest.hexdigest()


def _leaves(item: Any) -> Iterator[Any]:
    if isinstance(item, tuple | list):
        for part in item:
            yield from _leaves(part)
    else:
        yield item


@cache
def code_digest() -> str:
    """Digest of the code that computes tables: `CODE` and every module of ours that it reaches by its imports."""
    trees = dict[str, ast.Module]()
    left = [CODE]
    while left:
        module = left.pop()
        if module not in trees and module not in NO_PART:
            trees[module] = _parsed(module)
            left += _imported(trees[module])
    return digest_of(trees[module] for module in sorted(trees))


def digest_of(trees: Iterable[ast.Module]) -> str:
    """Digest of what code does, so that docstrings, comments and layout do not count."""
    digest = hashlib.sha256()
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
                node.body = node.body[1:]
        digest.update(ast.dump(tree).encode())
    return digest.hexdigest()


def _parsed(module: str) -> ast.Module:
    package, _, name = module.rpartition(".")
    return ast.parse((files(package) / f"{name}.py").read_bytes())


def _imported(tree: ast.Module) -> Iterator[str]:
    """Modules of this distribution's first package that a module imports; names are absolute here."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("piec_envs."):
            yield str(node.module)
