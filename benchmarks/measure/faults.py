"""Faults from outside: forks, threads, signals, full disks, damage."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Thread
from time import monotonic, sleep
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from rich.console import Console
from threadpoolctl import threadpool_info

from cdcp_igl import MapError, MeshError, SolverError, cdcp, datasets
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.command_line import entry
from cdcp_igl.io import WRITABLE, read_mesh, write_map
from cdcp_igl.io.output import remove_stale
from cdcp_igl.solve.solvers import SOLVERS

from ..records.store import WORK, code
from .worker import Jobs, WorkFolder, answered, kept_answers

SECONDS = 300.0  # after which a case hangs, on however busy a machine
THREADS = 8
SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGKILL")
FORMATS = tuple(suffix for suffix in WRITABLE if suffix != ".glb")  # those that can be read
FAULT = "FAULT: "  # how the outcomes begin that must not be


@dataclass(frozen=True)
class Row:
    """What became of a case."""

    kind: str
    case: int
    outcome: str = answered("")


def faults(
    cases: Annotated[int, typer.Option(min=1, help="How many of each kind.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="A case depends on this and its number.")] = 1,
    jobs: Jobs = 1,
    work: WorkFolder = None,
) -> None:
    """Disturb maps, files and batches in all ways that systems have.

    Exit code 1 if a process hangs or crashes, a result is not what it is undisturbed, a file is
    half written or left behind, or an error has no type. What has been examined is not examined
    again.
    """
    console = Console()
    requests = [Row(kind, case) for kind in DRILLS for case in range(cases)]
    kept = (work or WORK / code()) / f"faults-{seed}"
    rows = kept_answers(partial(examine, seed), requests, kept, SECONDS, jobs, console)
    console.print(pd.DataFrame(rows).groupby(["kind", "outcome"]).size().to_string())
    bad = [row for row in rows if row.outcome.startswith((FAULT, "crash", "hang"))]
    for row in bad:
        console.print(f"{row.kind} {row.case}: {row.outcome}")
    if bad:
        raise typer.Exit(1)


def examine(seed: int, row: Row) -> Row:
    """Disturb what a case says."""
    with TemporaryDirectory() as folder:
        try:
            rng = np.random.default_rng([seed, row.case])
            return replace(row, outcome=DRILLS[row.kind](rng, Path(folder)))
        except Exception as error:
            return replace(row, outcome=f"{FAULT}{type(error).__name__}: {error}")


# -- in this process -------------------------------------------------------------------


@cache
def _surfaces() -> list[tuple[Floats, Ints]]:
    known = datasets.square(50), datasets.spherical_cap(55), datasets.paraboloid(50, 3)
    return [(V, F) for V, F, _ in known]


def _mapped(surface: int, solver: str) -> Floats:
    return cdcp(*_surfaces()[surface], solver=solver)  # type: ignore[call-overload]


_undisturbed = cache(_mapped)


def _blas_threads() -> list[int]:
    return [pool["num_threads"] for pool in threadpool_info()]


def _fork(rng: np.random.Generator, folder: Path) -> str:
    """Fork while another thread maps; the child maps as well."""
    surface, solver, stop = int(rng.integers(3)), str(rng.choice(list(SOLVERS))), Event()
    expected = _undisturbed(surface, solver)

    def beside() -> None:
        while not stop.is_set():
            _mapped(surface, solver)

    thread = Thread(target=beside)
    thread.start()
    sleep(rng.uniform(0, 0.1))
    child = os.fork()
    if child == 0:
        _exit_with(lambda: np.array_equal(_mapped(surface, solver), expected))
    ended = _waited(child)
    stop.set()
    thread.join()
    return "as undisturbed" if ended == 0 else f"{FAULT}child ended with {ended}"


def _threads(rng: np.random.Generator, folder: Path) -> str:
    """Map in several threads at once: equal to the last bit, and BLAS has its threads back."""
    asked = [(int(rng.integers(3)), str(rng.choice(list(SOLVERS)))) for _ in range(THREADS)]
    expected = [_undisturbed(*each) for each in asked]
    before = _blas_threads()
    with ThreadPoolExecutor(THREADS) as threads:
        found = threads.map(lambda each: _mapped(*each), asked)
        equal = all(map(np.array_equal, found, expected))
    if _blas_threads() != before:
        return FAULT + "threads of BLAS"
    return "as undisturbed" if equal else FAULT + "another map"


def _damaged(rng: np.random.Generator, folder: Path) -> str:
    """Read a file of which some bytes are others, or that ends early."""
    V, F, _ = datasets.ellipse(4)
    path = folder / f"a{rng.choice(FORMATS)}"
    write_map(path, V, F, V[:, :2])
    data = bytearray(path.read_bytes())
    for place in rng.integers(len(data), size=rng.integers(1, 9)):
        data[place] = rng.integers(256)
    if rng.random() < 0.5:
        del data[rng.integers(len(data)) :]
    path.write_bytes(data)
    try:
        read_mesh(path)
    except MeshError:
        return "MeshError"
    return "read"


def _address_space(rng: np.random.Generator, folder: Path) -> str:
    """Map with little memory left."""
    solver = str(rng.choice(list(SOLVERS)))
    V, F, _ = datasets.spherical_cap(100)
    child = os.fork()
    if child == 0:
        import resource  # not on Windows

        size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        most = size + int(2 ** rng.uniform(16, 30))
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        _exit_with(lambda: len(cdcp(V, F, solver=solver)) > 0)  # type: ignore[call-overload]
    ended = _waited(child)
    typed = {0: "mapped", TYPED: "SolverError or MapError", NO_MEMORY: "MemoryError"}
    return typed.get(ended, f"{FAULT}child ended with {ended}")


# -- the program -----------------------------------------------------------------------

TYPED, NO_MEMORY, UNTYPED, OTHER = 3, 4, 5, 6  # exit codes of a child


def _exit_with(right: Callable[[], bool]) -> None:
    """End a child that was forked, with 0 if its answer is right; it is killed if it hangs."""
    signal.alarm(int(SECONDS / 2))
    ended = UNTYPED
    with suppress(BaseException):
        try:
            ended = 0 if right() else OTHER
        except (MapError, SolverError):
            ended = TYPED
        except MemoryError:
            ended = NO_MEMORY
    os._exit(ended)


def _waited(child: int) -> int:
    """Exit code of a child, or minus the signal that ended it."""
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _program(arguments: list[str], prepare: Callable[[], object] = lambda: None) -> int:
    """Run the command line in a child; return its process."""
    child = os.fork()
    if child:
        return child
    signal.alarm(int(SECONDS / 2))
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    sys.argv = ["cdcp-igl", *arguments]
    ended = UNTYPED
    with suppress(BaseException):
        try:
            prepare()
            entry.main()
        except SystemExit as end:
            ended = end.code if isinstance(end.code, int) else int(bool(end.code))
    os._exit(ended)


def _judged(folder: Path, out: Path, whole: bytes | None, ended: int) -> str:
    """Say whether a file is the old one or the new one, and nothing else is there."""
    remove_stale(folder, 0)  # what was killed cannot tidy up: who writes there a day later does
    left = sorted(path.name for path in folder.iterdir() if path.name not in ("in.npz", out.name))
    if left:
        return f"{FAULT}left behind {left}"
    if ended < 0 or ended == UNTYPED:
        return f"{FAULT}ended with {ended}"
    now = out.read_bytes()
    if now == b"old":
        return "the old file stays" if ended else FAULT + "nothing written"
    return "written" if now == whole else FAULT + "half a file"


def _to_write(rng: np.random.Generator, folder: Path) -> tuple[list[str], Path, bytes]:
    """Arguments of a program, the file that it will write, and what is in it then."""
    V, F, _ = datasets.spherical_cap(20)
    np.savez(folder / "in.npz", V=V, F=F)
    out = folder / f"out{rng.choice(FORMATS)}"
    arguments = ["map", str(folder / "in.npz"), str(out), "--force"]
    _waited(_program(arguments))
    whole = out.read_bytes()
    out.write_bytes(b"old")
    return arguments, out, whole


def _signal(rng: np.random.Generator, folder: Path) -> str:
    """Send a signal at any moment."""
    arguments, out, whole = _to_write(rng, folder)
    begun, begins = os.pipe()
    child = _program(arguments, partial(os.write, begins, b"."))
    os.read(begun, 1)
    sleep(rng.uniform(0.005, 1.5))
    os.close(begun)
    os.close(begins)
    name = str(rng.choice(SIGNALS))
    number = signal.Signals[name]
    os.kill(child, number)
    ended = _waited(child)
    if ended not in (0, 1, 128 + number, -number):
        return f"{FAULT}ended with {ended}"
    return f"{name}: " + _judged(folder, out, whole, abs(ended))


def _full_disk(rng: np.random.Generator, folder: Path) -> str:
    """Write where only a part of the file finds room, which a limit on files stands for."""
    import resource  # not on Windows

    arguments, out, whole = _to_write(rng, folder)
    most = int(rng.uniform(1, 1.2 * len(whole)))
    limited = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (most, most))
    return _judged(folder, out, whole, _waited(_program(arguments, limited)))


def _read_only(rng: np.random.Generator, folder: Path) -> str:
    """Write into a folder that takes nothing."""
    arguments, out, _ = _to_write(rng, folder)
    closed = folder / "closed"
    closed.mkdir(mode=0o555)
    target = Path("/proc") if os.access(closed, os.W_OK) else closed  # root may write anywhere else
    arguments[2] = str(target / out.name)
    ended = _waited(_program(arguments))
    closed.rmdir()
    return "refused" if ended == 1 else f"{FAULT}ended with {ended}"


def _killed_worker(rng: np.random.Generator, folder: Path) -> str:
    """Kill workers of a batch: it makes up for them."""
    V, F, _ = datasets.spherical_cap(12)
    scans, out = folder / "scans", folder / "out"
    scans.mkdir()
    for k in range(12):
        np.savez(scans / f"{k}.npz", V=V * [1, 1, 1 + k / 9], F=F)
    command = [sys.executable, "-m", "cdcp_igl", "batch", str(scans), str(out), "--jobs", "2"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as batch:
        deadline, killed = monotonic() + SECONDS / 2, 0
        while batch.poll() is None and monotonic() < deadline:
            sleep(rng.uniform(0, 1))
            if killed < 2 and (workers := children(batch.pid)):
                with suppress(ProcessLookupError):
                    os.kill(int(rng.choice(workers)), signal.SIGKILL)
                killed += 1
        if batch.poll() is None:
            batch.kill()
            return FAULT + "hang"
    for path in scans.iterdir():
        with np.load(path) as given, np.load(out / path.name) as made:
            if not np.array_equal(made["uv"], cdcp(given["V"], given["F"])):
                return FAULT + "another map"
    return "all done" if not list(out.glob(".*")) else FAULT + "left behind"


def children(process: int | str) -> list[int]:
    """List the processes that one has started, in whichever of its threads."""
    found = []
    for listed in Path(f"/proc/{process}/task").glob("*/children"):
        with suppress(OSError):
            found += [int(child) for child in listed.read_text().split()]
    return found


DRILLS: dict[str, Callable[[np.random.Generator, Path], str]] = {
    "fork beside a map": _fork,
    "maps in threads": _threads,
    "signal": _signal,
    "killed worker": _killed_worker,
    "full disk": _full_disk,
    "read-only folder": _read_only,
    "damaged file": _damaged,
    "address space": _address_space,
}
