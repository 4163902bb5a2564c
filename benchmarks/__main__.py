"""python -m benchmarks COMMAND."""

import typer

from . import draw, fuzz, measure, readme
from .surfaces import surfaces

app = typer.Typer(help=__doc__, no_args_is_help=True, add_completion=False)
app.command("tables")(measure.tables)
app.command("speed")(measure.speed)
app.command("ablation")(measure.ablation)
app.command("figures")(draw.figures)
app.command("fuzz")(fuzz.fuzz)
app.command("readme")(readme.readme)
app.command("surfaces")(surfaces)


@app.callback()
def _commands() -> None:
    """Measure cdcp_igl against other methods."""


if __name__ == "__main__":
    app()
