"""Batches that are killed in the middle, and run again."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from batches import batch, contents, lines, write_surfaces
from commands import ROOT
from commands import start as run

from benchmarks.measure.faults import children

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
def scans(tmp_path_factory):
    return write_surfaces(tmp_path_factory.mktemp("killed") / "scans", SURFACES)


@pytest.fixture(scope="module")
def whole(scans):
    batch([scans], scans.parent / "whole")
    return scans.parent / "whole"


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
    scans, whole, tmp_path, event, part, count, results, done
):
    out = tmp_path / "maps"
    killed = run("-c", KILLED, scans, out, event, part, count)
    assert killed.returncode == -signal.SIGKILL
    assert len(contents(out)) == results
    assert len(lines(out)) == done  # so each result that is there has a line
    assert contents(out).items() <= contents(whole).items()
    assert batch([scans], out).failed == ()
    assert contents(out) == contents(whole)
    assert measured(out) == measured(whole)
    assert sorted(path.name for path in out.iterdir()) == sorted(os.listdir(whole))


# -- with workers ----------------------------------------------------------------------


def start(scans, out):
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
    process = start(many, out)
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
    assert len(batch([many], out).done) == len(contents(out)) == 40
    assert not list(out.glob(".*"))
