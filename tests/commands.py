"""The program ``cdcp-igl``, run in this process or in one of its own."""

import os
import subprocess
import sys
from io import StringIO
from pathlib import Path
from textwrap import dedent

from typer.testing import CliRunner

import cdcp_igl
from cdcp_igl.command_line.program import app

ROOT = Path(cdcp_igl.__file__).parents[1]


def invoke(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def start(*command, environment=None, **options):
    """Run Python to its end with these arguments."""
    return subprocess.run(
        [sys.executable, *map(str, command)],
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **options},
        env={**os.environ, "PYTHONPATH": str(ROOT), **(environment or {})},
    )


def printed(code, **environment):
    """What a program prints, line by line."""
    done = start("-c", dedent(code), environment=environment)
    assert done.stdout, done.stderr
    return done.stdout.splitlines()


class Terminal(StringIO):
    """What is printed on a terminal."""

    def isatty(self):
        return True
