"""The program: its options, and a command for each thing to do."""

from __future__ import annotations

from typing import Annotated

import typer

from .. import __version__
from .batches import batch_command
from .certifying import certify_command
from .checking import check_command
from .comparing import compare_command
from .mapping import map_command
from .options import Command
from .parts import partition_command

app = typer.Typer(
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"cdcp-igl {__version__}")
        raise typer.Exit


@app.callback()
def cdcp_igl(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None:
    """Disk conformal maps of triangulated surfaces: accurate, fast, certified."""


MAP_EXAMPLES = """\b
Examples:
  cdcp-igl map face.obj disk.obj --refine 5 --report face.json --view face.html
  cdcp-igl map statue.obj charts.obj --clean --cut --free"""
BATCH_EXAMPLES = """\b
Examples:
  cdcp-igl batch scans maps --jobs 4 --report maps.html
  cdcp-igl batch 'eggs/*.ply' spheres --sphere --time-limit 600"""

app.command("check", cls=Command)(check_command)
app.command("certify", cls=Command)(certify_command)
app.command("map", cls=Command, epilog=MAP_EXAMPLES)(map_command)
app.command("compare", cls=Command)(compare_command)
app.command("batch", cls=Command, epilog=BATCH_EXAMPLES)(batch_command)
app.command("partition", cls=Command)(partition_command)
