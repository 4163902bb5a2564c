"""`batch`: what is left to do, done and written down."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...arguments import typed
from ...errors import counted, printable
from ...io import WRITABLE
from ...io.output import try_to_write, whole_file
from ..one_file import Settings
from ..pool import Pool
from .executors import Executor, run_on
from .journal import (
    DONE,
    SUMMARY_BEGINS,
    Journal,
    Record,
    ends_in_half_a_line,
    latest_records,
    read_journals,
    write_summary,
)
from .names import located, result_names, shard_of, surface_files
from .page import PAGE_BEGINS, report_page
from .work import Task

FORMATS = (*WRITABLE, ".gii")
SAME = "same"
ALIKE = 0.75  # are two names of which one is misspelt


@dataclass(frozen=True, eq=False)
class Batch:
    """What became of the surfaces of a batch. Printing it gives a summary.

    Attributes
    ----------
    folder : Path
        Of the results.
    records : tuple of Record
        One for each surface, in their order; those of former runs included.

    Examples
    --------
    >>> from pathlib import Path
    >>> import cdcp_igl
    >>> empty = cdcp_igl.scale.batching.Batch(Path("results"), ())
    >>> empty.done, empty.failed
    ((), ())
    """

    folder: Path
    records: tuple[Record, ...]

    @property
    def done(self) -> tuple[Record, ...]:
        """The surfaces that are mapped."""
        return tuple(record for record in self.records if record.status == DONE)

    @property
    def failed(self) -> tuple[Record, ...]:
        """The others."""
        return tuple(record for record in self.records if record.status != DONE)

    def __str__(self) -> str:
        surfaces = counted(len(self.records), "surface", "surfaces")
        lines = [f"{len(self.done):,} of {surfaces} mapped"]
        if self.done:
            mean = np.array([record.mean for record in self.done])
            flips = sum(record.flips for record in self.done)
            worse = sum(record.conformal is False for record in self.done)
            lines += [
                f"  mean angular distortion {np.median(mean):.3f}° in the median, "
                f"{mean.max():.3f}° at most",
                f"  {counted(flips, 'flipped face', 'flipped faces')}, "
                f"{counted(worse, 'map', 'maps')} not conformal",
            ]
        if left_out := [record for record in self.done if record.left_out]:
            vertices = counted(sum(r.left_out for r in left_out), "vertex", "vertices")
            lines.append(f"  {vertices} left out, of {counted(len(left_out), 'map', 'maps')}")
        lines += [
            f"  {count:,} {error}"
            for error, count in Counter(record.error for record in self.failed).most_common()
        ]
        return "\n".join(lines)


@typed
def batch(
    files: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    format: str = "npz",
    disk: bool = False,
    clean: bool = False,
    within: float = 0.0,
    cut: bool = False,
    free: bool = False,
    onto: Literal["sphere", "annulus", "rectangle"] | None = None,
    only: str | None = None,
    without: str | None = None,
    bake: int | None = None,
    retry: bool = False,
    force: bool = False,
    time_limit: float = np.inf,
    memory_limit: float = np.inf,
    shard: tuple[int, int] | None = None,
    report: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int, int], None] | None = None,
    **options: Any,
) -> Batch:
    """Map many surfaces, each to a file, and lose nothing.

    Each result has a line in ``results.jsonl``, with a digest of its bytes, before it appears, and
    appears whole or not at all. Run again after whatever has happened, a batch goes on where it
    was; the results are those of an undisturbed run. A file that is there already is replaced only
    if a batch has made it from the same surface with the same options, and nobody has changed it.

    A result has the name of its surface where no other one given has it, else its folders as well.
    So give a batch that is to go on the same folders as before, or always the one above them.

    Parameters
    ----------
    files : path-like or iterable of path-like
        Surfaces; folders, for all surfaces in them and below; patterns like ``"scans/*.obj"``.
    out : path-like
        Folder of the results, made if need be: ``NAME.npz`` for each surface, with folders
        where names would be the same, ``results.jsonl`` and ``summary.csv``.
    jobs : int
        Processes of this machine that map surfaces side by side. A surface that crashes its
        process is tried three times; others do not suffer. Large surfaces wait for each other
        where memory would not do for both.
    executor : concurrent.futures.Executor or dask.distributed.Client, optional
        Maps the surfaces instead, perhaps on many machines that share the file system.
    format : {"npz", "obj", "ply", "glb", "vtk", "vtp", "gii", "same"}
        Type of the results, see `cdcp_igl.io.write_map`; ``"same"`` for that of each surface, and
        obj where it is none of these. GIFTI has a map as positions of the vertices, in the rows of
        the surface, and needs nibabel.
    disk : bool
        Texture coordinates in the unit disk, not in the unit square.
    clean : bool
        Clean each surface first, see `cdcp_igl.clean`. A result has what is left of the surface,
        in its order.
    within : float
        With `clean`, merge vertices along seams that lie so near to each other, in the unit of the
        surface.
    cut : bool
        Map surfaces that are no disks as well, see `cdcp_igl.surface_map`.
    free : bool
        Map with free outlines, see `cdcp_igl.free_map`.
    onto : {"sphere", "annulus", "rectangle"} or None
        Map closed surfaces onto the sphere, see `cdcp_igl.sphere_map`; those with two boundary
        loops onto rings, see `cdcp_igl.annulus_map`; or disks onto rectangles, see
        `cdcp_igl.rectangle_map`, by the `corners` that all of them have.
    only, without : str or None
        Of each surface, map only the vertices that a file names, or leave them out: a FreeSurfer
        or GIFTI file as in ``"../label/{hemi}.cortex.label"`` or
        ``"../label/{hemi}.aparc.annot:unknown,corpuscallosum"``, see `cdcp_igl.io.read_vertices`.
    bake : int, optional
        Bake the images that the files show, by as many pixels a side, and write glb files that
        show them, see `Result.bake`.
    retry : bool
        Try again what failed in a former run.
    force : bool
        Replace what is there and was not made by a batch like this, but for the surfaces.
    time_limit, memory_limit : float
        Seconds and resident MiB for each surface, with `jobs` only. A surface beyond them has
        failed.
    shard : (int, int), optional
        Part i of n, from 1: every n-th surface, with a ``results.i-of-n.jsonl``; for job arrays
        that write to one folder.
    report : path-like, optional
        An HTML page to write, with a histogram and a table.
    progress : callable, optional
        Called as ``progress(done, failed, total)``, at first with what former runs have done.
    **options
        Those of the map that is made: `cdcp_igl.disk_map`, or that of `cut`, `free` or `onto`.

    Returns
    -------
    Batch

    Raises
    ------
    ValueError
        If an option is none that the map takes, or there is no surface. Nothing was done then.
    OSError
        If the folder or a result cannot be written, or another batch is writing there. What is
        done is kept.
    BrokenExecutor
        If no worker can be started, or the executor takes no more surfaces. What is done is kept.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(8)
    >>> with TemporaryDirectory() as folder:
    ...     for name, surface in (("cap", F), ("torn", F[1:])):
    ...         np.savez(Path(folder, name), V=V, F=surface)
    ...     made = cdcp_igl.batch([folder], Path(folder, "maps"))
    >>> [(record.name, record.status, record.error) for record in made.records]
    [('cap', 'done', ''), ('torn', 'failed', 'MeshError')]
    """
    for name in options:
        if meant := get_close_matches(name, signature(batch).parameters, 1, ALIKE):
            raise ValueError(f"{name}: no option of batch; did you mean {meant[0]}?")
    settings = Settings(disk, clean, cut, free, onto, options, only, without, within, bake)
    _check_format(format)
    if bake is not None and format != "glb":
        raise ValueError('bake writes images into glb files: it needs format="glb"')
    if executor is not None and (jobs, time_limit, memory_limit) != (1, np.inf, np.inf):
        raise ValueError("jobs and limits are those of the executor; give one or the other")
    if jobs < 1:
        raise ValueError(f"jobs must be 1 or more, not {jobs!r}")
    folder = located(Path(out))
    sources = surface_files(files, folder)
    if not sources:
        raise ValueError("there is no surface to map")
    digest = _digest_of_options(settings, format)
    named = list(zip(result_names(sources), sources, strict=True))
    mine = shard_of(named, shard)
    folder.mkdir(parents=True, exist_ok=True)
    summary_file = folder / "summary.csv"
    if not force:
        _refuse_another(summary_file, SUMMARY_BEGINS, "is no summary of a batch")
    if report is not None:
        if not force:
            _refuse_another(Path(report), PAGE_BEGINS, "is no report of a batch")
        try_to_write(Path(report))
    with Journal(folder, shard) as journal, _unfinished_folder(journal) as unfinished:
        tasks = [
            _task(name, source, folder / name, format, unfinished, settings, digest)
            for name, source in mine
        ]
        half = ends_in_half_a_line(folder)
        run = _Run(journal, tasks, read_journals(folder, digest), retry, force, progress, half)
        try:
            with closing(Pool(jobs, time_limit, memory_limit)) as pool:
                run.map(pool.run if executor is None else partial(run_on, executor))
        finally:
            # With those of other shards, and of other batches whose results are here.
            write_summary(summary_file, latest_records(folder))
    done = Batch(folder, tuple(run.records[task.name] for task in tasks))
    if report is not None:
        page = report_page(f"Maps in {printable(folder.name)}", str(done), done.records)
        with whole_file(report) as file:
            file.write_bytes(page.encode())
    return done


class _Run:
    """A batch while it runs: the records of what is done, `history` included, and what is left."""

    def __init__(
        self,
        journal: Journal,
        tasks: Sequence[Task],
        history: Mapping[str, Sequence[Record]],
        retry: bool,
        force: bool,
        progress: Callable[[int, int, int], None] | None,
        lacks_a_line: bool,
    ) -> None:
        self._lacks_a_line = lacks_a_line  # so that some result there may be one of these tasks
        self._journal, self._tasks, self._history = journal, tasks, history
        self._force, self._progress = force, progress
        self.records = {
            task.name: history[task.name][-1]
            for task in tasks
            if task.name in history and task.is_done(history[task.name][-1], retry)
        }
        self.count = Counter(record.status for record in self.records.values())

    def map(self, by: Callable[[Sequence[Task]], Generator[Record]]) -> None:
        """Map what is left by workers, and put each result into its place."""
        self._tell()
        left = {}
        for task in self._tasks:
            if task.name in self.records:
                continue
            refusal = None if self._lacks_a_line else self._refusal(task)
            if refusal:
                self._write_down(refusal)
            else:
                left[task.name] = task
        with closing(by(list(left.values()))) as made:
            for record in made:
                # What has come since is not replaced either, but by the same bytes.
                is_done = record.status == DONE
                refusal = self._refusal(left[record.name], record) if is_done else None
                self._write_down(refusal or record)  # first: each result there has a line
                if record.status == DONE and refusal is None:
                    left[record.name].move_draft()

    def _refusal(self, task: Task, *made: Record) -> Record | None:
        return task.refusal([*self._history.get(task.name, ()), *made], self._force)

    def _write_down(self, record: Record) -> None:
        self._journal.append(record.line())
        self.records[record.name] = record
        self.count[record.status] += 1
        self._tell()

    def _tell(self) -> None:
        if self._progress is not None:
            done = self.count[DONE]
            self._progress(done, self.count.total() - done, len(self._tasks))


def _digest_of_options(settings: Settings, format: str) -> str:
    text = json.dumps(_plain(asdict(settings) | {"format": format}), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: Any) -> Any:
    """Make JSON types of options, which may be arrays, or mappings of integers."""
    if isinstance(value, Mapping):
        return {str(key): _plain(given) for key, given in value.items()}
    return np.asarray(value).tolist()


def _refuse_another(path: Path, beginning: str, what: str) -> None:
    """Raise FileExistsError if there is a file that does not begin as ours do."""
    if not path.is_file():
        return
    with path.open("rb") as file:
        is_ours = file.read(len(beginning)) == beginning.encode()
    if not is_ours:
        reason = f"{what}; move it, name another place, or replace it by force"
        raise FileExistsError(errno.EEXIST, reason, os.fspath(path))


@contextmanager
def _unfinished_folder(journal: Journal) -> Iterator[Path]:
    """Make an empty folder for what is not finished, and remove it at the end."""
    path = journal.path.with_name(f".{journal.path.stem}.unfinished")
    _remove(path)  # of a run that was killed
    path.mkdir(exist_ok=True)
    try:
        yield path
    finally:
        _remove(path)


def _remove(path: Path) -> None:
    """Remove a folder, into which a task that an executor repeats may still want to write."""
    renamed = path.with_suffix(".removed")
    with suppress(OSError):
        path.rename(renamed)
    for left in (path, renamed):
        shutil.rmtree(left, ignore_errors=True)


def _check_format(format: str) -> None:
    formats = [*(suffix[1:] for suffix in FORMATS), SAME]
    if format not in formats:
        raise ValueError(f"format must be one of {', '.join(formats)}, not {format!r}")


def _task(
    name: str,
    source: Path,
    result: Path,
    format: str,
    unfinished: Path,
    settings: Settings,
    digest: str,
) -> Task:
    """Name the files of a surface, whose result is to be `result` with a suffix."""
    suffix = f".{format}"
    if format == SAME:
        suffix = source.suffix if source.suffix.lower() in FORMATS else ".obj"
    # Not the name of the result, which may be as long as names can be.
    draft = hashlib.sha256(f"{digest} {name}".encode(errors="surrogateescape")).hexdigest()
    target, draft = f"{result}{suffix}", f"{unfinished / draft}{suffix}"
    return Task(name, str(source), target, draft, settings, digest)
