"""The command line of the benchmarks, for their tests."""

import os
import subprocess
import sys
from pathlib import Path

from typer.testing import CliRunner

from benchmarks.commands import app

ROOT = Path(__file__).parents[1]


def benchmarks(*arguments, path=()):
    """Run a command in a process of its own, as it sets the threads of all libraries."""
    environment = {k: v for k, v in os.environ.items() if k != "CDCP_IGL_DATA"}
    if path:
        environment["PYTHONPATH"] = os.pathsep.join(map(str, [ROOT, *path]))
    return subprocess.run(
        [sys.executable, "-m", "benchmarks", *map(str, arguments)],
        **{"cwd": ROOT, "env": environment},
        **{"capture_output": True, "text": True, "timeout": 600},
    )


def in_one_line(told):
    """What a command says, without the frame and the lines that depend on the window."""
    return " ".join(told.replace("│", "").split())


def refused(*arguments):
    """Run a command that ends before it measures; return what it says, in one line."""
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert done.exit_code == 2, done.output
    return in_one_line(done.output)
