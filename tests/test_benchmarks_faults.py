"""The drill of faults: forks, threads, signals, killed workers, full disks, damaged files."""

import os

import pytest
from benchmark_commands import benchmarks

from benchmarks.measure.faults import DRILLS, FAULT, examine


@pytest.mark.skipif(not os.path.exists("/proc/self/task"), reason="needs Linux")
def test_nothing_that_is_disturbed_hangs_or_is_half_done(tmp_path):
    done = benchmarks("faults", "--cases", 2, "--work", tmp_path)
    assert done.exit_code == 0, done.stdout
    for kind in DRILLS:
        assert kind in done.stdout


def test_an_error_without_a_type_is_a_fault():
    assert examine(1, ("no kind", 0)).outcome.startswith(FAULT)
