"""How much the tests notice: small errors are put into the core, one at a time."""

from __future__ import annotations

import ast
import copy
import os
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import track

from ..records.store import ROOT

CORE = (
    *("algorithm.py", "selection.py", "certificate.py", "distortion.py"),
    *("steps", "rescue", "solve", "surface"),
)
# From the quickest to the slowest. Those that a tree does not have are left out.
TESTS = (
    *("mesh", "laplacian", "distortion", "refusals", "check", "injectivity"),
    *("mobius", "theory", "circle", "cholesky", "cdcp", "rescue", "mapper", "clean"),
    *("solvers", "platforms", "bijection", "refine", "hard_surfaces", "rectangle", "free_map"),
    *("annulus_map", "sphere_map", "cutting", "surface_map", "inputs", "parts"),
)
LEFT_BEHIND = (".git", ".venv", "build", "dist", "docs", "results", ".hypothesis", "__pycache__")

OTHERS: dict[type[ast.AST], tuple[type[ast.AST], ...]] = {
    **{ast.Add: (ast.Sub,), ast.Sub: (ast.Add,), ast.Mult: (ast.Div,), ast.Div: (ast.Mult,)},
    **{ast.Pow: (ast.Mult,), ast.FloorDiv: (ast.Mult,), ast.Mod: (ast.FloorDiv,)},
    **{ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt)},
    **{ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt)},
    **{ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,)},
    **{ast.And: (ast.Or,), ast.Or: (ast.And,), ast.BitAnd: (ast.BitOr,), ast.BitOr: (ast.BitAnd,)},
    **{ast.USub: (ast.UAdd,), ast.Not: (ast.UAdd,), ast.Invert: (ast.UAdd,)},
}
SILENT = (ast.Raise, ast.JoinedStr, ast.arguments, ast.Assert)  # errors and their texts
TYPES = ("returns", "annotation", "decorator_list")  # fields


@dataclass(frozen=True)
class Function:
    """A function or method: where it is, and its syntax."""

    path: Path
    node: ast.FunctionDef

    @property
    def key(self) -> str:
        """Its code without comments and docstring, by which it is the same in another tree."""
        return ast.unparse(_without_docstring(self.node))


@dataclass(frozen=True)
class Mutant:
    """A function with one error: the `number`-th place in it where there can be one."""

    function: Function
    number: int
    choice: float  # among its errors, from 0 to 1

    def code(self) -> tuple[int, str, str]:
        """Line of the error, what it changes, and the source of the function with it."""
        node = copy.deepcopy(_without_docstring(self.function.node))
        changed = list(_places(node))[self.number]
        before = ast.unparse(changed)
        _change(changed, self.choice)
        told = f"{before}  ->  {ast.unparse(changed)}"
        return changed.lineno, told, ast.unparse(node)


def mutants(
    count: Annotated[int, typer.Option(min=1, help="Of errors.")] = 60,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    tree: Annotated[Path, typer.Option(exists=True, help="A checkout of this project.")] = ROOT,
    shared_with: Annotated[
        Path | None,
        typer.Option(exists=True, help="Another: errors only in functions that both have."),
    ] = None,
    tests: Annotated[str, typer.Option(metavar="FILE,...", help="In the tree.")] = "",
    seconds: Annotated[float, typer.Option(min=1, help="After which an error is noticed.")] = 600,
) -> None:
    """Count the errors that the tests notice: an operator, sign, comparison or number is changed.

    Each is put into a copy of the tree, and the tests run until the first that fails. Those that
    no test notices are listed. Two trees with the same seed have the same errors if each is
    told the other by --shared-with.
    """
    chosen = tests.split(",") if tests else [f"tests/test_{name}.py" for name in TESTS]
    files = [name for name in chosen if (tree / name.partition("::")[0]).exists()]
    drawn = draw(functions(tree), count, seed, functions(shared_with) if shared_with else None)
    console, survivors = Console(), []
    with TemporaryDirectory() as folder:
        copied = Path(folder, "tree")
        shutil.copytree(tree, copied, ignore=shutil.ignore_patterns(*LEFT_BEHIND))
        if _noticed(copied, files, 10 * seconds):
            raise typer.BadParameter("they fail without any error", param_hint="--tests")
        for mutant in track(drawn, console=console, transient=True):
            target = copied / mutant.function.path.relative_to(tree)
            whole = target.read_text(encoding="utf-8")
            line, told, code = mutant.code()
            source = whole.splitlines()[line - 1].strip()
            target.write_text(_with(whole, mutant.function.node, code), encoding="utf-8")
            noticed = _noticed(copied, files, seconds)
            target.write_text(whole, encoding="utf-8")
            place = f"{mutant.function.path.relative_to(tree)}:{line}"
            outcome = "killed" if noticed else "SURVIVED"
            text = f"{outcome} {place}: {source}  #  {told}"
            console.print(text, markup=False, soft_wrap=True)
            survivors += [] if noticed else [place]
    console.print(f"{len(drawn) - len(survivors)} of {len(drawn)} killed, seed {seed}")
    for place in survivors:
        console.print(f"survived: {place}", markup=False, soft_wrap=True)


def functions(tree: Path) -> dict[str, Function]:
    """Find the functions of the core of a checkout, in the order of their code."""
    paths = [path for name in CORE for path in _sources(tree / "cdcp_igl" / name)]
    found = [
        Function(path, node)
        for path in paths
        for node in _defined(ast.parse(path.read_text(encoding="utf-8")).body)
    ]
    return {function.key: function for function in sorted(found, key=lambda one: one.key)}


def draw(
    found: dict[str, Function], count: int, seed: int, others: dict[str, Function] | None
) -> list[Mutant]:
    """Draw errors, each place with the same probability."""
    places = [
        (function, number)
        for key, function in found.items()
        if others is None or key in others
        for number in range(len(list(_places(_without_docstring(function.node)))))
    ]
    rng = np.random.default_rng(seed)
    rows = rng.permutation(len(places))[:count].tolist()
    choices = rng.random(len(rows)).tolist()
    chosen = zip(rows, choices, strict=True)
    return [Mutant(places[row][0], places[row][1], choice) for row, choice in chosen]


def _defined(body: list[ast.stmt]) -> Iterator[ast.FunctionDef]:
    """Functions and methods, without those inside of functions."""
    for node in body:
        if isinstance(node, ast.FunctionDef):
            yield node
        if isinstance(node, ast.ClassDef):
            yield from _defined(node.body)


def _sources(path: Path) -> list[Path]:
    return sorted(path.rglob("*.py")) if path.is_dir() else [path] if path.exists() else []


def _without_docstring(node: ast.FunctionDef) -> ast.FunctionDef:
    if ast.get_docstring(node) is None:
        return node
    bare = copy.copy(node)
    bare.body = node.body[1:] or [ast.Pass()]
    return bare


def _places(node: ast.AST) -> Iterator[Any]:
    """Yield the expressions and statements in which something can be changed."""
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) else [value]:
            if name in TYPES or not isinstance(child, ast.AST) or isinstance(child, SILENT):
                continue
            number = isinstance(child, ast.Constant) and isinstance(child.value, int | float)
            if number or type(_operator(child)) in OTHERS:
                yield child
            yield from _places(child)


def _operator(node: Any) -> Any:
    return node.ops[0] if isinstance(node, ast.Compare) else getattr(node, "op", None)


def _change(node: Any, choice: float) -> None:
    if isinstance(node, ast.Constant):
        value: Any = node.value
        of_number = value + 1 if isinstance(value, int) else 2 * value
        node.value = not value if isinstance(value, bool) else of_number
        return
    others = OTHERS[type(_operator(node))]
    other: Any = others[int(choice * len(others))]()
    if isinstance(node, ast.Compare):
        node.ops[0] = other
    else:
        node.op = other


def _with(whole: str, node: ast.FunctionDef, code: str) -> str:
    """Replace a function in the text of its file."""
    lines = whole.splitlines()
    first = min([node.lineno, *(one.lineno for one in node.decorator_list)]) - 1
    made = textwrap.indent(code, " " * node.col_offset).splitlines()
    return "\n".join([*lines[:first], *made, *lines[node.end_lineno :]]) + "\n"


def _noticed(tree: Path, tests: list[str], seconds: float) -> bool:
    """Whether a test fails, or takes too long."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", "not slow", *tests]
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            command, cwd=tree, env=environment, timeout=seconds, capture_output=True
        )
    except subprocess.TimeoutExpired:
        return True
    return done.returncode != 0
