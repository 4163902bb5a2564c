"""Workers that die, hang and grow, disks that are full, batches that are killed and run again."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import meshes
import numpy as np
import pytest
from batches import WORKERS, contents, invoke, lines, write_surfaces, write_torn
from batches import batch as in_this_process
from commands import ROOT, start

from benchmarks.measure.faults import children
from cdcp_igl import datasets
from cdcp_igl.reference.case import run_case
from cdcp_igl.scale import pool
from cdcp_igl.scale.batching import batch
from cdcp_igl.scale.batching.work import memory_needed


@pytest.fixture
def unruly(monkeypatch):
    """Workers that die, hang and grow, by the name of the surface."""
    path = os.environ.get("PYTHONPATH", "")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(WORKERS), str(ROOT), path]))


def write_unruly(folder, *names):
    for name in names:
        V, F = meshes.grid()
        np.savez(folder / f"{name}_x.npz", V=V, F=F)


@pytest.mark.usefixtures("unruly")
def test_one_surface_does_not_cost_the_others(scans, tmp_path):
    write_unruly(scans, "kill", "once", "words", "hang", "hog", "chatty")
    limits = {"time_limit": 4, "memory_limit": 500}
    made = batch([scans], tmp_path / "maps", jobs=2, **limits)
    said = {record.name: (record.error, record.message) for record in made.failed}
    assert said == {
        "kill_x": ("Crash", "crashed: SIGKILL (3 times)"),
        "words_x": ("Crash", "failed: last words (3 times)"),
        "hang_x": ("TimeLimit", "no result within 4 s"),
        "hog_x": ("MemoryLimit", "more than 500 MiB of memory"),
    }
    assert len(made.done) == 5
    seen = []
    batch([scans], tmp_path / "maps", progress=lambda *counts: seen.append(counts), **limits)
    assert seen == [(5, 4, 9)]


def test_a_worker_that_cannot_start(scans, tmp_path, monkeypatch):
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "numpy.py").write_text("raise ImportError('no numpy today')")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(broken), str(ROOT)]))
    done = invoke(scans, tmp_path / "maps", "-q")
    said = "no worker can be started: failed: ImportError: no numpy today\n"
    assert (done.exit_code, done.stderr) == (1, said)
    assert lines(tmp_path / "maps") == []


def test_files_where_the_user_works_are_no_modules(scans, tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.chdir(tmp_path)
    for name in ("random", "numpy"):
        Path(f"{name}.py").write_text("raise ImportError('this is a script')")
    assert len(batch([scans], "maps").done) == 3
    assert run_case("lscm", *meshes.grid(), time_limit=60)[0].outcome == "ok"


def test_large_surfaces_wait_for_each_other(scans, tmp_path, monkeypatch):
    monkeypatch.setattr(pool, "available_memory", lambda: 100 * 2**20)
    made = batch([scans], tmp_path / "maps", jobs=3)
    assert len(made.done) == 3
    ends = [datetime.fromisoformat(record.finished).timestamp() for record in made.done]
    spans = sorted((end - r.seconds, end) for end, r in zip(ends, made.done, strict=True))
    for (_, end), (begin, _) in pairwise(spans):
        assert end <= begin


@pytest.mark.parametrize("suffix", ["npz", "obj", "off", "ply", "stl"])
def test_the_memory_is_guessed_from_above(tmp_path, suffix):
    V, F = meshes.grid(40, 50)
    path = tmp_path / f"grid.{suffix}"
    if suffix == "npz":
        np.savez_compressed(path, V=V, F=F)
    else:
        trimesh = pytest.importorskip("trimesh")
        trimesh.Trimesh(V, F, process=False).export(path)
    least = memory_needed(tmp_path / "missing.obj")
    assert least + 2000 * 1e-3 < memory_needed(path) < least + 2000 * 1e-2
    path.with_name("odd.npz").write_bytes(b"no archive")  # which ends no batch
    assert memory_needed(path.with_name("odd.npz")) == least


# -- disks and folders that take nothing ----------------------------------------------


def test_a_full_disk(scans, tmp_path):
    """The largest result does not fit, which a limit on the size of files stands for."""
    resource = pytest.importorskip("resource")
    V, F, _ = datasets.spherical_cap(9)
    np.savez(scans / "large.npz", V=V, F=F)
    in_this_process([scans], tmp_path / "whole")
    out = tmp_path / "maps"
    limit = max(path.stat().st_size for path in (tmp_path / "whole").glob("*.npz")) - 1000
    done = start(
        *("-m", "cdcp_igl", "batch", scans, out),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert done.returncode == 1
    said = f"Not written: {out / 'large.npz'}: {os.strerror(27)}. What is done is kept"
    assert done.stderr.startswith(said)
    assert not list(out.glob(".*"))
    assert in_this_process([scans], out).failed == ()
    assert contents(out) == contents(tmp_path / "whole")


def test_a_folder_that_cannot_be_written(scans):
    for folder, reason in (("/proc/maps", ""), (scans / "surface_000.npz", "File exists")):
        done = invoke(scans, folder)
        assert done.exit_code == 1
        assert f"{folder}: {reason}" in done.stderr


# -- executors -------------------------------------------------------------------------


@pytest.mark.usefixtures("unruly")
def test_an_executor_that_breaks(scans, tmp_path):
    """It cannot be mended; what it has not come to is left for another run."""
    write_unruly(scans, "kill")
    out = tmp_path / "maps"
    spawned = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
    with spawned as executor, pytest.raises(BrokenExecutor, match="are left for"):
        batch([scans], out, executor=executor)
    assert [line["error"] for line in lines(out) if line["status"] == "failed"] == ["Crash"]
    with ProcessPoolExecutor(2) as executor:
        assert len(batch([scans], out, executor=executor).done) == 3
    in_this_process([scans / "surface_*.npz"], tmp_path / "whole")
    assert contents(out) == contents(tmp_path / "whole")
    assert not list(out.glob(".*"))


# -- Dask ------------------------------------------------------------------------------


@pytest.fixture
def cluster(unruly):
    distributed = pytest.importorskip("distributed")
    dask = pytest.importorskip("dask")
    # Port 0 is any that is free; without it the first of two suites on one machine has 8787.
    options = {"threads_per_worker": 1, "processes": True, "dashboard_address": ":0"}
    # Dask gives up a worker that is killed while it starts, as happens on a busy machine. Others
    # take its place; without any, the test would wait for ever.
    with (
        dask.config.set({"distributed.scheduler.no-workers-timeout": "60s"}),
        distributed.LocalCluster(n_workers=2, **options) as cluster,
    ):
        cluster.adapt(minimum=2, maximum=2)
        yield cluster


def test_dask(scans, tmp_path, cluster):
    write_unruly(scans, "once", "kill", "chatty")
    write_torn(scans / "torn.npz")
    batch([scans], tmp_path / "whole", jobs=2)
    with cluster.get_client() as client:
        made = batch([scans], tmp_path / "maps", executor=client)
    said = {record.name: (record.error, record.message) for record in made.failed}
    assert said.pop("torn")[0] == "MeshError"
    assert said == {"kill_x": ("Crash", "the worker died (3 times)")}
    assert len(made.done) == 5
    assert contents(tmp_path / "maps") == contents(tmp_path / "whole")
    assert not list(tmp_path.glob("*/.*"))
    done = invoke(scans / "torn.npz", tmp_path / "one", "--scheduler", cluster.scheduler_address)
    assert (done.exit_code, done.stderr) == (4, "")
    assert "0 of 1 surface mapped" in done.stdout


def test_no_scheduler(scans, tmp_path):
    pytest.importorskip("distributed")
    dask = pytest.importorskip("dask")
    with dask.config.set({"distributed.comm.timeouts.connect": "2s"}):  # rather than 30
        done = invoke(scans, tmp_path / "maps", "--scheduler", "tcp://127.0.0.1:9")
    assert done.exit_code == 1
    assert done.stderr.startswith("No scheduler answers at tcp://127.0.0.1:9: ")
    assert len(done.stderr.splitlines()) == 1


# -- batches that are killed in the middle, and run again ------------------------------


SURFACES = 5

# A batch in one process, which maps all surfaces before it writes the first line, and kills itself
# before it does something to a file the n-th time.
KILLED = """
import os, signal, sys
from concurrent.futures import Executor, Future
import cdcp_igl
scans, out, event, part, count = sys.argv[1:]
left = int(count)

def watch(name, arguments):
    global left
    if name == event and part in " ".join(map(str, arguments[:2])):
        left -= 1
        if not left:
            os.kill(os.getpid(), signal.SIGKILL)

class AtOnce(Executor):
    def submit(self, function, *arguments):
        future = Future()
        future.set_result(function(*arguments))
        return future

sys.addaudithook(watch)
cdcp_igl.batch(scans, out, executor=AtOnce())
"""


def measured(folder):
    """The lines that count, without what depends on the clock and the machine."""
    latest = {line["name"]: line for line in lines(folder) if line["status"] == "done"}
    for line in latest.values():
        for name in ("seconds", "memory", "finished"):
            del line[name]
    return latest


@pytest.fixture(scope="module")
def five(tmp_path_factory):
    return write_surfaces(tmp_path_factory.mktemp("killed") / "scans", SURFACES)


@pytest.fixture(scope="module")
def whole(five):
    in_this_process([five], five.parent / "whole")
    return five.parent / "whole"


@pytest.mark.parametrize(
    ("event", "part", "count", "results", "done"),
    [
        ("os.mkdir", ".unfinished", 1, 0, 0),  # nothing has begun
        ("os.rename", ".unfinished/.cdcp_igl", 3, 0, 0),  # two drafts are written
        ("os.rename", "maps/surface_", 3, 2, 3),  # a result has a line, and is not in its place
        ("os.rename", "maps/summary.csv", 1, 5, 5),  # the last one is
        ("shutil.rmtree", ".unfinished", 2, 5, 5),  # all is done
    ],
)
def test_killed_the_results_are_those_of_an_undisturbed_run(
    five, whole, tmp_path, event, part, count, results, done
):
    out = tmp_path / "maps"
    killed = start("-c", KILLED, five, out, event, part, count)
    assert killed.returncode == -signal.SIGKILL
    assert len(contents(out)) == results
    assert len(lines(out)) == done  # so each result that is there has a line
    assert contents(out).items() <= contents(whole).items()
    assert in_this_process([five], out).failed == ()
    assert contents(out) == contents(whole)
    assert measured(out) == measured(whole)
    # What was unfinished goes a day later.
    left = (path.name for path in out.iterdir() if not path.name.startswith(".cdcp_igl"))
    assert sorted(left) == sorted(os.listdir(whole))


# -- with workers ----------------------------------------------------------------------


def begin(scans, out):
    return subprocess.Popen(
        [sys.executable, "-m", "cdcp_igl", "batch", str(scans), str(out), "--jobs", "2"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )


def lives(pid):
    """Whether a process still runs. Where init does not wait for orphans, they remain, as Z."""
    try:
        state = Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2]
    except OSError:
        return False
    return not state.startswith(b" Z")


def wait_for_end(pids):
    deadline = time.monotonic() + 10
    while time.monotonic() < deadline and any(map(lives, pids)):
        time.sleep(0.005)
    assert not any(map(lives, pids))


def wait_for_lines(out, count, process):
    journal = out / "results.jsonl"
    while process.poll() is None:
        if journal.exists() and journal.read_bytes().count(b"\n") >= count:
            return
        time.sleep(0.005)


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    return write_surfaces(tmp_path_factory.mktemp("many") / "scans", 40, rows=8, columns=12)


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux to find workers")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_killed_workers_cost_nothing_and_none_outlives_its_batch(many, tmp_path, number):
    out = tmp_path / "maps"
    process = begin(many, out)
    wait_for_lines(out, 3, process)
    workers = children(process.pid)
    assert len(workers) == 2
    os.kill(workers[0], signal.SIGKILL)
    wait_for_lines(out, len(lines(out)) + 3, process)
    workers = children(process.pid)
    process.send_signal(number)
    _, errors = process.communicate(timeout=30)
    wait_for_end(workers)
    if number != signal.SIGKILL:
        assert process.returncode == 128 + number
        assert (out / "summary.csv").exists()
    assert errors == ("Interrupted\n" if number == signal.SIGINT else "")
    assert 5 <= len(lines(out)) < 40
    assert {line["status"] for line in lines(out)} == {"done"}
    assert len(in_this_process([many], out).done) == len(contents(out)) == 40
    assert not list(out.glob(".*"))
