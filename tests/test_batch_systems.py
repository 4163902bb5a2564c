"""Batches on full disks and on systems that lack what Linux has."""

import os
import signal

import numpy as np
import pytest
from batches import batch, contents, invoke, write_surfaces
from commands import start

from cdcp_igl import processes
from cdcp_igl.datasets import spherical_cap


@pytest.fixture
def scans(tmp_path):
    return write_surfaces(tmp_path / "scans", 3)


def test_a_full_disk(scans, tmp_path):
    """The largest result does not fit, which a limit on the size of files stands for."""
    resource = pytest.importorskip("resource")
    V, F, _ = spherical_cap(9)
    np.savez(scans / "large.npz", V=V, F=F)
    batch([scans], tmp_path / "whole")
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
    assert batch([scans], out).failed == ()
    assert contents(out) == contents(tmp_path / "whole")


def test_a_folder_that_cannot_be_written(scans):
    for folder, reason in (("/proc/maps", ""), (scans / "surface_000.npz", "File exists")):
        done = invoke(scans, folder)
        assert done.exit_code == 1
        assert f"{folder}: {reason}" in done.stderr


def test_why_a_process_ended():
    assert processes.cause_of_death(-signal.SIGSEGV, "") == "crashed: SIGSEGV"
    assert processes.cause_of_death(-123, "") == "crashed: signal 123"
    assert processes.cause_of_death(3, "first\nlast\n") == "failed: last"
    assert processes.cause_of_death(3, "") == "failed: no message"
