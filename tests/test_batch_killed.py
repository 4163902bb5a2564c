"""Batches that are killed in the middle, and run again."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from batches import ROOT, contents, write_surfaces

from cdcp_igl.batching import batch
from cdcp_igl.batching.journal import read_journals
from cdcp_igl.batching.work import digest_of_settings
from cdcp_igl.one_file import Settings

SURFACES = 40
KILLS = 50


@pytest.fixture
def scans(tmp_path):
    return write_surfaces(tmp_path / "scans", SURFACES, rows=8, columns=12)


def start(scans, out, *options):
    return subprocess.Popen(
        [sys.executable, "-m", "cdcp_igl", "batch", str(scans), str(out), "--jobs", "2", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )


def numbers(out):
    """The records, without what depends on the clock and the machine."""
    measured = {"seconds", "memory", "finished"}
    return {
        name: {key: value for key, value in record.values().items() if key not in measured}
        for name, record in read_journals(out, digest_of_settings(Settings())).items()
    }


def workers_of(process):
    listed = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    try:
        return [int(pid) for pid in listed.read_text().split()]
    except OSError:
        return []


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


def kill_at_random(chance, process, out):
    """Kill the batch or one of its workers, once it has come some way; return what was killed."""
    known = len(contents(out)) if out.exists() else 0
    wait_for_lines(out, known + chance.randrange(8), process)
    time.sleep(chance.uniform(0, 0.03))
    if process.poll() is not None:
        return ""
    workers = workers_of(process)
    if workers and chance.random() < 0.6:
        try:
            os.kill(chance.choice(workers), signal.SIGKILL)
        except ProcessLookupError:
            return ""
        return "worker"
    process.kill()
    wait_for_end(workers)  # a slow disk may hold them for longer than the next batch takes
    return "batch"


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux to find workers")
def test_killed_at_random_the_results_are_those_of_an_undisturbed_run(scans, tmp_path):
    batch([scans], tmp_path / "whole", jobs=2)
    expected, records = contents(tmp_path / "whole"), numbers(tmp_path / "whole")
    assert len(expected) == SURFACES
    chance = random.Random(1)
    killed, rounds = {"worker": 0, "batch": 0, "": 0}, 0
    while killed["worker"] + killed["batch"] < KILLS:
        rounds += 1
        out = tmp_path / f"maps{rounds}"
        done = False
        while not done:
            # A surface whose worker was killed three times has failed: it is tried again.
            process = start(scans, out, "--retry")
            while process.poll() is None and (what := kill_at_random(chance, process, out)):
                killed[what] += 1
                for name, data in contents(out).items():  # whole, at every moment
                    assert data == expected[name]
                if what == "batch":
                    break
            _, errors = process.communicate()
            done = process.returncode == 0
            assert process.returncode in (0, 4, -signal.SIGKILL), errors
        assert contents(out) == expected
        assert numbers(out) == records
        assert sorted(path.name for path in out.iterdir() if path.name not in expected) == [
            "results.jsonl",
            "summary.csv",
        ]
    assert min(killed["worker"], killed["batch"]) > KILLS // 5


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted(scans, tmp_path, number):
    out = tmp_path / "maps"
    process = start(scans, out)
    wait_for_lines(out, 5, process)
    workers = workers_of(process)
    process.send_signal(number)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 128 + number
    assert errors == ("Interrupted\n" if number == signal.SIGINT else "")
    done = len((out / "results.jsonl").read_text().splitlines())
    assert 5 <= done < SURFACES
    assert (out / "summary.csv").exists()
    for pid in workers:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    again = start(scans, out)
    _, errors = again.communicate(timeout=60)
    assert (again.returncode, len(contents(out))) == (0, SURFACES), errors


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux to find workers")
def test_workers_do_not_outlive_a_batch_that_was_killed(scans, tmp_path):
    process = start(scans, tmp_path / "maps")
    wait_for_lines(tmp_path / "maps", 3, process)
    workers = workers_of(process)
    assert len(workers) == 2
    process.kill()
    process.communicate()
    wait_for_end(workers)
