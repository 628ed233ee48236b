"""What the docstring of a public function or class lacks, read off its source.

The law is for what takes two or more arguments. A method that implements a documented one may say
"...; see `Base.method`." instead.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

ENOUGH = 2  # arguments, from which on a function has sections
SECTIONS = {"Args", "Returns", "Yields", "Raises"}
ENTRY = re.compile(r" {4}(\*{0,2}\w+(?:(?:, | and )\*{0,2}\w+)*):(?: |$)")
# What says how an array is laid out: its shape, or that it is another's, which is documented.
LAYOUT = re.compile(r"\bshapes?\b|\bnumbers\b|\b(?:as|as in|of|from|an?|the|see) `")
SEE = re.compile(r"\bsee `([\w.]+)\.(\w+)`")
AS_OTHERS = re.compile(r"\bas `")  # as in "as `make_disc` does"
ARRAYS = {"np.ndarray", "np.ndarray | None"}
NOTHING = {"None", "Iterator[None]", "NoReturn"}
NO_ARGUMENT = re.compile(r"^_|\bClassVar\b|\binit=False\b")  # in the line of a field
FUNCTION = (ast.FunctionDef, ast.AsyncFunctionDef)


class Public(NamedTuple):
    """A public class or function, and where it stands."""

    name: str
    node: ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
    in_class: bool
    docstring: str


def public(node: ast.Module | ast.ClassDef, prefix: str = "") -> Iterator[Public]:
    """Everything public in a module, in its public classes too; nothing that a function holds."""
    for child in node.body:
        if not isinstance(child, (ast.ClassDef, *FUNCTION)) or child.name.startswith("_"):
            continue
        in_class = isinstance(node, ast.ClassDef)
        docstring = ast.get_docstring(child) or ""
        yield Public(prefix + child.name, child, in_class, docstring)
        if isinstance(child, ast.ClassDef):
            yield from public(child, f"{prefix}{child.name}.")


def sections(text: str) -> dict[str, list[str]]:
    """Lines of each section of a docstring in Google's style; "" holds what comes before."""
    found: dict[str, list[str]] = {"": []}
    name = ""
    for line in inspect.cleandoc(text).splitlines():
        heading = line.removesuffix(":") in SECTIONS
        name = line[:-1] if heading else name
        found.setdefault(name, []).extend([] if heading else [line])
    return found


def entries(lines: list[str]) -> dict[str, str]:
    """What a section says of each name, of names that share a line too."""
    texts: dict[str, str] = {}
    names: list[str] = []
    for line in lines:
        entry = ENTRY.match(line)
        names = re.split(r", | and ", entry.group(1).replace("*", "")) if entry else names
        rest = line[entry.end() :] if entry else line.strip()
        texts.update({name: f"{texts.get(name, '')} {rest}" for name in names})
    return texts


def own_nodes(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes below one, but for those of functions and classes inside it."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, (ast.ClassDef, ast.Lambda, *FUNCTION)):
            yield child
            yield from own_nodes(child)


def decorators(node: ast.AST) -> set[str]:
    """Last names of the decorators."""
    called = (item.func if isinstance(item, ast.Call) else item for item in node.decorator_list)
    return {ast.unparse(item).split(".")[-1] for item in called}


def parameters(function: ast.AST, in_class: bool) -> list[ast.arg]:
    """The arguments without self or cls, and without those whose names begin with "_"."""
    a = function.args
    places = [*a.posonlyargs, *a.args]
    if in_class and "staticmethod" not in decorators(function):
        places = places[1:]
    given = [*places, a.vararg, *a.kwonlyargs, a.kwarg]
    return [arg for arg in given if arg is not None and not arg.arg.startswith("_")]


def arrays(function: ast.AST, args: list[ast.arg]) -> set[str]:
    """Arguments that are arrays: by annotation, or because a kernel indexes them."""
    names = {arg.arg for arg in args if arg.annotation and ast.unparse(arg.annotation) in ARRAYS}
    if not any("kernel" in name for name in decorators(function)):
        return names
    bare = {arg.arg for arg in args if not arg.annotation}
    reads = [n for n in own_nodes(function) if isinstance(n, ast.Subscript | ast.Attribute)]
    used = {ast.unparse(n.value) for n in reads if getattr(n, "attr", "shape") == "shape"}
    return names | (bare & used)


def caught(attempt: ast.Try) -> set[str]:
    """Exception classes that a `try` catches and does not raise again as they are."""
    bare = [h for h in attempt.handlers if "raise" in map(ast.unparse, own_nodes(h))]
    kinds = [handler.type for handler in attempt.handlers if handler.type and handler not in bare]
    return {node.id for kind in kinds for node in ast.walk(kind) if isinstance(node, ast.Name)}


def raised(function: ast.AST) -> set[str]:
    """Exception classes that leave a function by a `raise` in its own body."""
    tries = [node for node in own_nodes(function) if isinstance(node, ast.Try)]
    inside = {(n, name) for t in tries for s in t.body for n in ast.walk(s) for name in caught(t)}
    raises = [node for node in own_nodes(function) if isinstance(node, ast.Raise) and node.exc]
    named = {(node, ast.unparse(node.exc).split("(")[0].split(".")[-1]) for node in raises}
    return {name for _, name in named - inside if name[0].isupper()}


def outcome(function: ast.AST) -> str | None:
    """Which section says what comes back, by the body; None if nothing does."""
    if function.returns is not None and ast.unparse(function.returns) in NOTHING:
        return None
    if any(isinstance(node, ast.Yield | ast.YieldFrom) for node in own_nodes(function)):
        return "Yields"
    given = {ast.unparse(node) for node in own_nodes(function) if isinstance(node, ast.Return)}
    return "Returns" if given - {"return", "return None"} else None


def summary_faults(lines: list[str]) -> Iterator[str]:
    """A first paragraph that is not one sentence."""
    end = lines.index("") if "" in lines else len(lines)
    first = " ".join(lines[:end])
    if not first.endswith("."):
        yield "the first paragraph does not end a sentence"
    if re.search(r"[.?!]\)? +[A-Z]", first):
        yield "the first paragraph is more than one sentence"


def argument_faults(names: list[str], shaped: set[str], text: Mapping[str, str]) -> Iterator[str]:
    """Arguments without a line in Args, and arrays that are said to have no shape."""
    for name in names:
        if name not in text:
            yield f"Args does not name {name}"
        elif name in shaped and not LAYOUT.search(text[name]):
            yield f"{name} is an array without a shape"


def raise_faults(names: set[str], why: str) -> Iterator[str]:
    """Exceptions that a text does not name, unless it refers to another function's."""
    unnamed = set() if AS_OTHERS.search(why) else names - set(re.findall(r"\w+", why))
    yield from (f"Raises does not name {name}" for name in sorted(unnamed))


def function_faults(item: Public, documented: Mapping[str, str]) -> Iterator[str]:
    """What the docstring of a function lacks, if that has two or more arguments."""
    if len(args := parameters(item.node, item.in_class)) < ENOUGH:
        return
    found = sections(item.docstring)
    yield from summary_faults(found[""])
    see = SEE.search(" ".join(found[""]))
    if see and see.group(2) == item.node.name and "Args" not in found:
        inherited = sections(documented.get(".".join(see.groups()), ""))
        found = {key: inherited.get(key, []) + found.get(key, []) for key in {*inherited, *found}}
    text = entries(found.get("Args", []))
    yield from argument_faults([arg.arg for arg in args], arrays(item.node, args), text)
    if (kind := outcome(item.node)) and not {kind, "Returns"} & set(found):
        yield f"there is no {kind} section"
    yield from raise_faults(raised(item.node), " ".join(found.get("Raises", [])))


def own_fields(node: ast.ClassDef) -> dict[str, ast.AnnAssign]:
    """Public annotated names of a class body that its constructor takes."""
    fields = {ast.unparse(f.target): f for f in node.body if isinstance(f, ast.AnnAssign)}
    return {name: f for name, f in fields.items() if not NO_ARGUMENT.search(ast.unparse(f))}


def has_comment(field: ast.AnnAssign, lines: list[str]) -> bool:
    """Whether a field has a comment on its line or, too long for that, above it."""
    last = (field.end_lineno or 0) - 1
    return "  # " in lines[last] or lines[field.lineno - 2].lstrip().startswith("# ")


def class_faults(item: Public, lines: list[str]) -> Iterator[str]:
    """What the docstring of a class lacks of its fields, or of what `__init__` takes and raises."""
    found = sections(item.docstring)
    text = entries(found.get("Args", []))
    fields = own_fields(item.node)
    if "NamedTuple" in map(ast.unparse, item.node.bases):
        commented = {name for name, field in fields.items() if has_comment(field, lines)}
        yield from argument_faults([name for name in fields if name not in commented], set(), text)
    elif "dataclass" in decorators(item.node):
        shaped = {name for name, f in fields.items() if ast.unparse(f.annotation) in ARRAYS}
        yield from argument_faults(list(fields) if len(fields) >= ENOUGH else [], shaped, text)
    for made in (f for f in item.node.body if isinstance(f, FUNCTION) and f.name == "__init__"):
        if len(args := parameters(made, in_class=True)) >= ENOUGH:
            yield from argument_faults([arg.arg for arg in args], arrays(made, args), text)
            yield from raise_faults(raised(made), " ".join(found.get("Raises", [])))


def methods_with_args(sources: list[str]) -> dict[str, str]:
    """Docstrings of public methods that have Args, by "Class.method"."""
    items = (item for source in sources for item in public(ast.parse(source)))
    return {i.name: i.docstring for i in items if i.in_class and "Args" in sections(i.docstring)}


def faults(source: str, documented: Mapping[str, str] | None = None) -> list[str]:
    """Whatever the public docstrings of a module lack; `documented` is None if it stands alone."""
    known = methods_with_args([source]) if documented is None else documented
    found = []
    lines = source.splitlines()
    for item in public(ast.parse(source)):
        of_class = isinstance(item.node, ast.ClassDef)
        lacks = class_faults(item, lines) if of_class else function_faults(item, known)
        found += [f"{item.node.lineno} {item.name}: {fault}" for fault in lacks]
    return found
