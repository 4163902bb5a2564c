"""The package as a whole: what `import cdcp_igl` gives, and which way its modules look."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import cdcp_igl

PACKAGE = Path(cdcp_igl.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))

# From the ground up; a folder stands for its modules. Those of one floor may use one another.
FLOORS = (
    {"arguments", "arrays", "cached", "docstrings"},
    {"defects"},
    {"errors", "printing", "fields"},
    {"libigl", "extras"},
    {"surface", "io"},
    {"verdict"},
    {"plot"},
    {"solve"},
    {"steps", "phases"},
    {"options"},
    {"algorithm", "records", "starts"},
    {"descent"},
    {"result"},
    {"maps"},
    {"atlas"},
    {"scale", "datasets"},
    {"reference"},
    {"command_line", "__init__", "__main__"},
)
FLOOR = {name: number for number, floor in enumerate(FLOORS) for name in floor}


def dotted(path: Path) -> str:
    """The name of a module; a package is called by the name of its folder."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts)


SOURCES = {dotted(path): path for path in MODULES}


def imported(name: str) -> set[str]:
    """Modules of the package that one of them imports, wherever in its text, even for types."""
    path = SOURCES[name]
    package = path.relative_to(PACKAGE).parts[:-1]
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            full = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = ["cdcp_igl", *package][: len(package) - node.level + 2] if node.level else []
            target = [*above, *(node.module.split(".") if node.module else [])]
            full = [[*target, alias.name] for alias in node.names if alias.name != "__version__"]
        else:
            continue
        for root, *parts in full:
            if root == "cdcp_igl":
                whole, part = ".".join(parts), ".".join(parts[:-1])
                found.add(whole if whole in SOURCES else part or "__init__")
    return found


def test_imports_go_down():
    upward = [
        f"{name} imports {other}"
        for name in SOURCES
        for other in imported(name)
        if FLOOR[other.partition(".")[0]] > FLOOR[name.partition(".")[0]]
    ]
    assert upward == []


def test_there_is_no_circle_of_imports():
    graph = {name: imported(name) - {name} for name in SOURCES}
    TopologicalSorter(graph).prepare()  # CycleError names the modules


def test_no_module_is_hidden_by_a_function():
    hidden = [
        f"{name}.{node.name}"
        for name, path in SOURCES.items()
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
        and path.with_name(f"{node.name}.py").exists()
    ]
    assert hidden == []


def test_dir_shows_what_is_public():
    assert {"DiskMap", "MeshReport", "Certificate", "Cleaned"} < set(dir(cdcp_igl))
    assert dir(cdcp_igl) == sorted(cdcp_igl.__all__)
    for name in dir(cdcp_igl):
        assert getattr(cdcp_igl, name) is not None
    with pytest.raises(AttributeError):
        _ = cdcp_igl.no_such_name
