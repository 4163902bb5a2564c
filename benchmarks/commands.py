"""The commands."""

from __future__ import annotations

from typing import Annotated

import typer

from .measure.ablation import ABLATIONS, RESCUES
from .measure.against import against as in_turn
from .measure.any_surface import surfaces
from .measure.families import FAMILIES, disks
from .measure.faults import faults
from .measure.fuzzing import fuzz
from .measure.machine import MACHINE, pin_threads
from .measure.methods import maps
from .measure.models import subdivided
from .measure.mutants import mutants
from .measure.peers import PEERS
from .measure.punctures import punctures
from .measure.worker import WorkFolder, wide_console
from .records.record import Record
from .records.results import Measured
from .records.store import ROOT, WORK, Work
from .session import Machine, Out, Session, with_session
from .write.front_page import MODELS, README, rewrite
from .write.report import draw
from .write.sections import cases, rescue_table, summary_table
from .write.table import printed

SPEED_METHODS = ("factor", "cdcp", "cdcp refine=5", "free", "lscm", "harmonic")
SPEED_MODELS = (
    *("chinese_lion", "stanford_bunny_31593", "human_brain", "itokawa_93920", "gcanyon_216196"),
    *("nefertiti_750281", "gcanyon_996999"),
)
SMALL_MODEL, SMALL_METHODS = "nefertiti_299", ("cdcp warm", "import")
MOVING_MODELS, MOVING_METHOD = ("chinese_lion", "gcanyon_216196"), "cdcp sequence"
GROWTH_METHODS = ("factor", "cdcp")
ROUNDS, QUICK_ROUNDS = 6, 2  # of subdivision: up to 4 million vertices, or 16,000
REPEATED = ("factor", "cdcp")  # the others run once on large models
LARGE = 500_000  # vertices
ABLATION_MODELS = (
    *("nefertiti_299", "camelhead_11381", "chinese_lion", "human_face", "stanford_bunny_31593"),
    *("human_brain", "left_hand"),
)

TOLD = ("surface", "method", "mean °", "SD °", "flips", "s", "s / F", "outcome")
LONG = 400  # rows of a table that can still be read; of a longer one its sums are printed
RESULTS = ROOT / "benchmarks" / "results"  # only `make bench` writes there
# Beside which other programs are shown.
OWN = (
    *("cdcp", "cdcp refine=5", "free", "free refine=5", "free keep=lengths"),
    *("lscm", "bff", "bff_disk", "abf", "slim", "arap"),
)

Repeats = Annotated[int, typer.Option(min=1, help="Runs of each case.")]

app = typer.Typer(
    help="Measure cdcp_igl against other methods.", no_args_is_help=True, add_completion=False
)
app.command()(fuzz)
app.command()(faults)
app.command()(surfaces)
app.command()(punctures)
app.command()(mutants)


@app.command()
@with_session
def tables(session: Session, repeats: Repeats = 1) -> None:
    """Measure Tables 1 and 2: distortion and time of all methods on all models.

    What is there already is not measured again. To start over, delete the work folder.
    """
    methods = session.wanted_methods(["factor", *maps()])
    records = session.run("tables", session.wanted_models(), methods, lambda *_: repeats)
    _finish(session, "tables", records)


@app.command()
@with_session
def peers(session: Session) -> None:
    """Measure other programs beside CDCP: Blender, MeshLab, xatlas.

    Those that are not installed are told. What is there already is not measured again.
    """
    methods = session.wanted_methods((*OWN, *PEERS))
    _finish(session, "peers", session.run("peers", session.wanted_models(MODELS), methods))


@app.command()
@with_session
def speed(
    session: Session,
    repeats: Repeats = 5,
    against: Annotated[
        str,
        typer.Option(metavar="COMMIT", help="Map by the library of a commit and by this, in turn."),
    ] = "",
) -> None:
    """Measure times as multiples of one factorization, memory, growth; methods take turns.

    Growth is that on one terrain, subdivided from 1,000 to 4 million vertices, which takes 6 GiB;
    one run each. Neither it nor small meshes and moving ones are measured if methods or surfaces
    are chosen.

    Above 500,000 vertices all but CDCP and the factorization run once.

    What is there already is not measured again. To start over, delete the work folder.

    With --against nothing of this is measured, but how long this code takes by that of a commit, in
    each phase: CDCP, with options behind it, in so many rounds.
    """
    if against:
        pin_threads(session.threads)
        models = session.wanted_models((SMALL_MODEL, *SPEED_MODELS))
        table = in_turn(against, models, session.wanted_methods(["cdcp"]), repeats)
        wide_console().print(printed(table, table.headings))
        return

    def runs(method: str, n: int) -> int:
        return 1 if n > LARGE and method not in REPEATED else repeats

    records = []
    wanted = session.wanted_methods(SPEED_METHODS)
    models = session.wanted_models(SPEED_MODELS)
    if not session.models and not session.methods:
        small = session.wanted_models([SMALL_MODEL])[:1]
        records += session.run("speed", small, SMALL_METHODS, runs)
        moving = session.wanted_models(MOVING_MODELS)
        records += session.run("speed", moving, [MOVING_METHOD], runs)
        grown = subdivided(QUICK_ROUNDS if session.tier == "quick" else ROUNDS)
        session.write("growth", session.run("growth", grown, GROWTH_METHODS))
    records += session.run("speed", models, wanted, runs)
    _finish(session, "speed", records)


@app.command()
@with_session
def ablation(
    session: Session,
    families: Annotated[str, typer.Option(metavar="NAME,...", help="Of disks.")] = ",".join(
        FAMILIES
    ),
    count: Annotated[int, typer.Option(min=1, help="Disks of each family.")] = 5,
    most: Annotated[int, typer.Option(min=1, help="Vertices of the largest of them.")] = 5_000,
) -> None:
    """Measure CDCP with a step of Algorithm 1 changed, then with a part of its rescue left out.

    The steps on scans; the rescue on families of disks, or on the models that are chosen. What is
    there already is not measured again. To start over, delete the work folder.
    """
    wanted = session.wanted_methods([*ABLATIONS, *RESCUES])
    if steps := [name for name in wanted if name not in RESCUES]:
        models = session.wanted_models(ABLATION_MODELS)
        _finish(session, "ablation", session.run("ablation", models, steps))
    if rescues := [name for name in wanted if name in RESCUES]:
        chosen = session.models or session.tier
        models = session.wanted_models() if chosen else disks(_known(families), count, most)
        _finish(session, "rescue", session.run("rescue", models, rescues))


def _known(families: str) -> list[str]:
    """Names of families, as they were typed."""
    names = [name for name in families.split(",") if name]
    for name in names:
        if name not in FAMILIES:
            text = f"{name!r} is not one of {', '.join(FAMILIES)}."
            raise typer.BadParameter(text, param_hint="--families")
    return names


def _finish(session: Session, section: str, records: list[Record]) -> None:
    console = wide_console()
    results = session.write(section, records).sections[section]
    table, headings = cases(results), list(TOLD)
    if section == "rescue" or len(table.rows) > LONG:
        table = (rescue_table if section == "rescue" else summary_table)(results)
        headings = list(table.headings)
    console.print(printed(table, headings))
    if section == "rescue":
        console.print(table.text)
    if session.part is None:
        typer.echo(session.results.with_suffix(".md"))
    else:
        typer.echo("A part; once all are there, the same without --shard writes the results.")


@app.command()
def figures(machine: Machine = MACHINE, out: Out = None, work: WorkFolder = None) -> None:
    """Draw Figures 4 to 12 and the report for the browser, from what has been measured.

    Nothing is measured again.
    """
    session = Session(machine=machine, out=out, work=work)
    if not session.results.exists():
        raise typer.BadParameter(
            f"there is no {session.results}; first run: python -m benchmarks tables"
        )
    about, records = session.earlier()
    kept = Work(work or WORK / about["code"])
    measured = Measured(records, kept.surface, kept.map)
    typer.echo(draw(session.results.with_suffix(""), about, measured))


@app.command()
def readme(machine: Machine = MACHINE) -> None:
    """Rewrite the table between the two markers of README.md from benchmarks/results."""
    results = RESULTS / f"{machine}.json"
    if not results.exists():
        raise typer.BadParameter(f"there is no {results}; first run: make bench")
    rewrite(README, results)
