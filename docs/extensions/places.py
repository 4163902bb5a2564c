"""The page that says where each equation of the paper and each public name is in the code.

Equations are found where comments and docstrings cite them: ``# (18)``, ``eq. (18)``, and
``eqs. (1)-(6)`` for all from the first to the last.
"""

import ast
import io
import re
import tokenize
from importlib import import_module
from pathlib import Path
from types import ModuleType

import cdcp_igl

PACKAGE = Path(cdcp_igl.__file__).parent
PUBLIC = ("", ".datasets", ".io", ".plot", ".reference")
EQUATIONS = range(1, 21)
NOT_CITED = (9, 11, 12, 16)  # no step of the program is one of these by itself
CITED = re.compile(r"\beqs?\. \(\d+\)(?:(?:-|, |,? and )\(\d+\))*")
NUMBERS = re.compile(r"(?<![\w)])\((\d{1,2})\)(?:[-–]\((\d{1,2})\))?")

HEAD = """# Where it is in the code

Written from the sources when these pages were built; lines are those of the files in `cdcp_igl/`.

## Equations of the paper

Where comments and docstrings cite them: first the modules that are the paper's steps.
"""


def equations():
    """Map each number of an equation to its places: file, line, and function or class."""
    found = {number: [] for number in EQUATIONS}
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text)
        for line, cited in sorted(_citations(text, tree)):
            for first, last in NUMBERS.findall(cited):
                for number in range(int(first), int(last or first) + 1):
                    place = path.relative_to(PACKAGE).as_posix(), line, _around(tree, line)
                    if number in found and place not in found[number]:
                        found[number].append(place)
    return {number: sorted(places, key=_of_the_paper) for number, places in found.items()}


def _citations(text, tree):
    """Yield lines with what they cite: all of a comment, of a docstring what follows eq."""
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string
    for node in ast.walk(tree):
        documented = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        if documented and ast.get_docstring(node):
            first = node.body[0]
            for k, line in enumerate(lines[first.lineno - 1 : first.end_lineno]):
                yield from ((first.lineno + k, cited[0]) for cited in CITED.finditer(line))


def _around(tree, line):
    """The innermost function or class at a line; empty if there is none."""
    names = [
        node.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef | ast.FunctionDef)
        and node.lineno <= line <= node.end_lineno
    ]
    return names[-1] if names else ""


def _of_the_paper(place):
    folder = place[0].split("/")[0]
    return folder not in ("steps", "solve", "algorithm.py", "distortion.py"), place


def public_names():
    """Yield each public name with its file and line."""
    for suffix in PUBLIC:
        module = import_module(f"cdcp_igl{suffix}")
        for name in module.__all__:
            yield f"{module.__name__}.{name}", *_home(module, name)


def _home(module, name):
    value = getattr(module, name)
    if isinstance(value, ModuleType):
        return _relative(value), 1
    home = getattr(value, "__module__", None)
    candidates = [import_module(home)] if home else _modules_below(module)
    for candidate in candidates:
        tree = ast.parse(Path(candidate.__file__).read_text(encoding="utf-8"))
        for node in tree.body:
            target = node.target if isinstance(node, ast.AnnAssign) else None
            targets = node.targets if isinstance(node, ast.Assign) else [target]
            if name in (getattr(node, "name", None), *(getattr(t, "id", None) for t in targets)):
                return _relative(candidate), node.lineno
    raise LookupError(f"{module.__name__}.{name} is defined nowhere")


def _modules_below(package):
    """The modules of a folder, for what does not know where it is from."""
    for path in sorted(Path(package.__file__).parent.glob("[!_]*.py")):
        yield import_module(f"{package.__name__}.{path.stem}")


def _relative(module):
    return Path(module.__file__).relative_to(PACKAGE).as_posix()


def page():
    rows = ["| equation | cited at |", "|---|---|"]
    for number, places in equations().items():
        told = [f"`{file}:{line}`" + f" {name}" * bool(name) for file, line, name in places]
        without = "no line: no step of the program is this equation by itself"
        rows.append(f"| ({number}) | {', '.join(told) or without} |")
    names = ["| name | file |", "|---|---|"]
    names += [f"| `{name}` | `{file}:{line}` |" for name, file, line in public_names()]
    return "\n".join([HEAD, *rows, "\n## Public names\n", *names, ""])


def _write(app):
    target = Path(app.srcdir, "generated", "places.md")
    target.parent.mkdir(exist_ok=True)
    target.write_text(page(), encoding="utf-8")


def setup(app):
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": False}
