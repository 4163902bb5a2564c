"""python -m benchmarks COMMAND."""

import typer

from . import fuzz, readme

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False)
app.command("fuzz")(fuzz.fuzz)
app.command("readme")(readme.write)


@app.callback()
def _commands() -> None:
    """Measure cdcp_igl against other methods."""


if __name__ == "__main__":
    app()
