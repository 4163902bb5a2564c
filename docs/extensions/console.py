"""The directive ``{console}``: commands that are run when the pages are built, and their output.

Each line is a ``cdcp-igl`` command, run in a folder with the files that `SURFACES` makes.
The option ``exit`` is the exit code that the commands must have, 0 unless given.
"""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import ClassVar

import igl
import numpy as np
from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

import cdcp_igl

WIDTH = "100"


def _mountain():
    """Every fourth sample of the terrain, a grid of 86 by 101."""
    V, _ = cdcp_igl.datasets.load("jacksboro_fault")
    V = V.reshape(344, 403, 3)[::4, ::4]
    rows, columns, _ = V.shape
    return V.reshape(-1, 3), igl.triangulated_grid(columns, rows)[1][:, ::-1]


def _torn():
    """The mountain with a hole, where a vertex has lost its faces, and a face reversed."""
    V, F = _mountain()
    F = np.delete(F, np.flatnonzero((F == 4300).any(axis=1)), axis=0)
    F[10] = F[10, ::-1]
    return V, F


def _corridor():
    """A strip sixty times longer than wide."""
    V, F = igl.triangulated_grid(241, 5)
    return np.column_stack([60 * V[:, 0], V[:, 1], 0 * V[:, 0]]), F


SURFACES = {"mountain": _mountain, "torn": _torn, "corridor": _corridor}


class Console(SphinxDirective):
    has_content = True
    option_spec: ClassVar = {"exit": directives.nonnegative_int}

    def run(self):
        folder = self.env.app.console_folder.name
        text = []
        for line in self.content:
            program, *arguments = line.split()
            done = subprocess.run(
                [sys.executable, "-m", "cdcp_igl", *arguments],
                cwd=folder,
                env={**os.environ, "COLUMNS": WIDTH, "TERM": "dumb", "NO_COLOR": "1"},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                check=False,
            )
            if program != "cdcp-igl" or done.returncode != self.options.get("exit", 0):
                raise ExtensionError(f"{line}: exit code {done.returncode}\n{done.stdout}")
            output = [kept.rstrip() for kept in done.stdout.splitlines()]
            text += [f"$ {line}", *output]
        block = nodes.literal_block("\n".join(text), "\n".join(text), language="console")
        if not any(mark in "\n".join(text) for mark in "│┃"):  # no table
            block["classes"].append("wrapped")
        return [block]


def _make_surfaces(app):
    app.console_folder = TemporaryDirectory(prefix="cdcp_igl-docs-")
    for name, make in SURFACES.items():
        V, F = make()
        with Path(app.console_folder.name, f"{name}.obj").open("w") as file:
            np.savetxt(file, V, "v %.17g %.17g %.17g")
            np.savetxt(file, F + 1, "f %d %d %d")


def setup(app):
    app.add_directive("console", Console)
    app.connect("builder-inited", _make_surfaces)
    app.connect("build-finished", lambda app, _: app.console_folder.cleanup())
    return {"parallel_read_safe": False}
