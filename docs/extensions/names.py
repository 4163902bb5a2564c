"""The index of the reference: a line for each name that its pages document."""

import importlib
import inspect
import re
from pathlib import Path

MODULE = re.compile(r"^\.\. (?:module|currentmodule|automodule):: (\S+)")
NAME = re.compile(r"^\.\. auto(?:function|class|exception|data):: (\w+)")


def documented(page):
    """Full names of what a page documents."""
    module = "cdcp_igl"
    for line in page.read_text(encoding="utf-8").splitlines():
        if found := MODULE.match(line):
            module = found[1]
        elif found := NAME.match(line):
            yield f"{module}.{found[1]}"


def line_of(full):
    module, _, name = full.rpartition(".")
    value = getattr(importlib.import_module(module), name)
    told = inspect.getdoc(value) if callable(value) else ""
    return f"- {{py:obj}}`{name} <{full}>`" + (f": {told.splitlines()[0]}" if told else "")


def _write(app):
    reference = Path(app.srcdir, "reference")
    text = (reference / "index.md").read_text(encoding="utf-8")
    pages = re.search(r":maxdepth: 1\n\n(.*?)```", text, re.DOTALL)[1].split()
    lines = []
    for page in pages:
        if page == "internals":
            continue
        if names := [line_of(full) for full in documented(reference / f"{page}.md")]:
            lines += [f"**{{doc}}`/reference/{page}`**\n", *names, ""]
    parts = Path(app.srcdir, "generated", "parts")
    parts.mkdir(parents=True, exist_ok=True)
    (parts / "names.md").write_text("\n".join(lines), encoding="utf-8")


def setup(app):
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": False}
