"""`batch`: what is left to do, done and written down."""

from __future__ import annotations

import hashlib
import os
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import counted, printable
from ..extras import from_extra
from ..io import remove_stale, whole_file
from ..io.output import try_to_write
from ..one_file import Settings
from .executors import run_on
from .journal import Journal, is_summary, read_journals, write_summary
from .names import located, result_names, surface_files
from .page import report_page
from .pool import Pool
from .records import DONE, FAILED, Record
from .shards import Shard, shard_of
from .stamps import Stamp, put_stamp, read_stamp
from .targets import refuse_another
from .work import Task, digest_of_settings

__all__ = ["Batch", "batch"]

NO_INPUT = hashlib.sha256().hexdigest()  # of a report, which is made from no single surface


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
    >>> empty = cdcp_igl.batching.Batch(Path("results"), ())
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
            worse = sum(not record.conformal for record in self.done)
            lines += [
                f"  mean angular distortion {np.median(mean):.3f}° in the median, "
                f"{mean.max():.3f}° at most",
                f"  {counted(flips, 'flipped face', 'flipped faces')}, "
                f"{counted(worse, 'map', 'maps')} not conformal",
            ]
        lines += [
            f"  {count:,} {error}"
            for error, count in Counter(record.error for record in self.failed).most_common()
        ]
        return "\n".join(lines)


def batch(
    files: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    jobs: int = 1,
    executor: Any = None,
    format: str = "npz",
    disk: bool = False,
    clean: bool = False,
    cut: bool = False,
    retry: bool = False,
    time_limit: float = np.inf,
    memory_limit: float = np.inf,
    shard: tuple[int, int] | None = None,
    report: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int, int], None] | None = None,
    **options: Any,
) -> Batch:
    """Map many surfaces, each to a file, and lose nothing.

    Each result is written by its worker, whole or not at all, and noted in a line of
    ``results.jsonl``. Run again after whatever has happened, a batch goes on where it was;
    the results are those of an undisturbed run. A file that is there already is replaced only
    if it was made from the same surface with the same options.

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
    format : {"npz", "obj", "ply", "glb"}
        Type of the results, see `cdcp_igl.io.write_map`.
    disk : bool
        Texture coordinates in the unit disk, not in the unit square.
    clean : bool
        Mend each surface first, see `cdcp_igl.clean`. A result has what is left of the surface,
        in its order.
    cut : bool
        Map surfaces that are no disks as well, see `cdcp_igl.surface_map`.
    retry : bool
        Try again what failed in a former run.
    time_limit, memory_limit : float
        Seconds and resident MiB for each surface, with `jobs` only. A surface beyond them has
        failed.
    shard : (int, int), optional
        Part i of n, from 1: every n-th surface, with a ``results.i-of-n.jsonl``; for job arrays
        that write to one folder.
    report : path-like, optional
        An HTML page to write, with a histogram, a table and a picture of each disk, as far as
        it was mapped with a report. Needs the extra `plot`.
    progress : callable, optional
        Called as ``progress(done, failed, total)``, at first with what former runs have done.
    **options
        Those of `cdcp_igl.disk_map`, or of `cdcp_igl.surface_map`.

    Returns
    -------
    Batch

    Raises
    ------
    ValueError
        If an option is none of those allowed, or there is no surface. Nothing was done then.
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
    settings = Settings(format=format, disk=disk, clean=clean, cut=cut, options=options)
    limits = {"time_limit": time_limit, "memory_limit": memory_limit}
    if executor is not None and (jobs, *limits.values()) != (1, np.inf, np.inf):
        raise ValueError("jobs and limits are those of the executor; give one or the other")
    if jobs < 1:
        raise ValueError(f"jobs must be 1 or more, not {jobs!r}")
    folder = located(Path(out))
    tasks = _tasks(surface_files(files, folder), folder, settings, shard, report is not None)
    folder.mkdir(parents=True, exist_ok=True)
    summary_file = folder / "summary.csv"
    refuse_another(summary_file, is_summary, "is no summary of a batch")
    if report is not None:
        with from_extra("plot"):
            import matplotlib  # noqa: F401
        refuse_another(Path(report), _is_report, "is no report of a batch")
        try_to_write(Path(report))
    with Journal(folder, shard) as journal:
        known = read_journals(folder, digest_of_settings(settings))
        records = {
            task.name: known[task.name]
            for task in tasks
            if task.name in known and _settled(task, known[task.name], retry)
        }
        left = [task for task in tasks if task.name not in records]
        count = Counter(record.status for record in records.values())
        tell = progress or (lambda done, failed, total: None)
        tell(count[DONE], count.total() - count[DONE], len(tasks))
        marks = folder / f".{journal.path.stem}.attempts"
        pool = Pool(jobs, **limits)
        made = pool.run(left) if executor is None else run_on(executor, left, marks)
        try:
            with closing(made):
                for record in made:
                    journal.append(record)
                    records[record.name] = record
                    count[record.status] += 1
                    tell(count[DONE], count.total() - count[DONE], len(tasks))
        finally:
            for place in {os.path.dirname(task.target) for task in tasks}:
                remove_stale(place)  # of workers that were killed
            summary = read_journals(folder, digest_of_settings(settings))
            write_summary(summary_file, (summary[name] for name in sorted(summary)))
    done = Batch(folder, tuple(records[task.name] for task in tasks))
    if report is not None:
        pictures = {task.name: Path(task.thumbnail) for task in tasks}
        page = report_page(f"Maps in {printable(folder.name)}", str(done), done.records, pictures)
        with whole_file(report) as unfinished:
            unfinished.write_text(page, encoding="utf-8")
            put_stamp(unfinished, Stamp(NO_INPUT, digest_of_settings(settings)))
    return done


def _is_report(path: Path) -> bool:
    stamp = read_stamp(path)
    return stamp is not None and stamp.input == NO_INPUT


def _tasks(
    files: list[Path],
    folder: Path,
    settings: Settings,
    shard: Shard | None,
    pictures: bool,
) -> Sequence[Task]:
    if not files:
        raise ValueError("there is no surface to map")
    tasks = [
        Task(
            name,
            str(file),
            str(folder / f"{name}.{settings.format}"),
            settings,
            str(folder / "thumbnails" / f"{name}.jpg") if pictures else "",
        )
        for name, file in zip(result_names(files), files, strict=True)
    ]
    return shard_of(tasks, shard)


def _settled(task: Task, record: Record, retry: bool) -> bool:
    """Whether a former run has done with this surface, as it is now."""
    if (record.input, record.input_size, record.input_mtime) != (task.source, *task.state()):
        return False
    if record.status == DONE:  # and the result is what it was
        target, stamp = Path(task.target), Stamp(record.input_digest, record.options_digest)
        return target.is_file() and read_stamp(target) == stamp
    return record.status == FAILED and not retry
