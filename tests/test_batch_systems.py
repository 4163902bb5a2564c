"""Batches on full disks and on systems that lack what Linux has."""

import os
import signal

import numpy as np
import pytest
from batches import ROOT, command, contents, write_surfaces

from cdcp_igl import processes
from cdcp_igl.batching import batch


@pytest.fixture
def scans(tmp_path):
    return write_surfaces(tmp_path / "scans", 5)


def test_a_full_disk(scans, tmp_path):
    """The largest result does not fit, which a limit on the size of files stands for."""
    resource = pytest.importorskip("resource")
    V = np.random.default_rng(0).normal(size=(300, 3))
    V[:, 2] = 0
    from scipy.spatial import Delaunay

    np.savez(scans / "large.npz", V=V, F=Delaunay(V[:, :2]).simplices)
    batch([scans], tmp_path / "whole")
    out = tmp_path / "maps"
    limit = max(path.stat().st_size for path in (tmp_path / "whole").glob("*.npz")) - 1000
    done = command(
        *(scans, out),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert done.returncode == 1
    said = f"Not written: {out / 'large.npz'}: {os.strerror(27)}. What is done is kept"
    assert done.stderr.startswith(said)
    assert not list(out.glob(".*"))
    again = command(scans, out)
    assert again.returncode == 0, again.stderr
    assert contents(out) == contents(tmp_path / "whole")


def test_a_folder_that_cannot_be_written(scans):
    done = command(scans, "/proc/maps")
    assert done.returncode == 1
    assert "/proc/maps: " in done.stderr
    done = command(scans, scans / "surface_000.npz")
    assert done.returncode == 1
    assert "surface_000.npz: File exists" in done.stderr


def test_a_report_that_cannot_be_written(scans, tmp_path):
    done = command(scans, tmp_path / "maps", "--report", "/proc/page.html")
    assert done.returncode == 1
    assert "/proc/page.html: " in done.stderr
    assert not list((tmp_path / "maps").iterdir())


@pytest.mark.parametrize("module", ["fcntl", "resource", "pwd"])
def test_without_modules_that_windows_lacks(scans, tmp_path, module):
    folder = tmp_path / "windows"
    folder.mkdir()
    missing = f"raise ModuleNotFoundError('none', name={module!r})\n"
    (folder / f"{module}.py").write_text(missing)
    path = os.pathsep.join([str(folder), str(ROOT)])
    done = command(scans, tmp_path / "maps", "-j", "2", env={**os.environ, "PYTHONPATH": path})
    assert done.returncode == 0, done.stderr
    assert "5 of 5 surfaces mapped" in done.stdout


def test_memory_where_there_is_no_proc(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "PROC", tmp_path / "proc" / "self")
    assert processes.resident(os.getpid()) >= 0  # from ps, if there is one
    assert not processes.peak_memory() <= 0
    processes.forget_peak_memory()
    monkeypatch.setenv("PATH", "")
    assert processes.resident(os.getpid()) == 0


def test_why_a_process_ended():
    assert processes.cause_of_death(-signal.SIGSEGV, "") == "crashed: SIGSEGV"
    assert processes.cause_of_death(-123, "") == "crashed: signal 123"
    assert processes.cause_of_death(3, "first\nlast\n") == "failed: last"
    assert processes.cause_of_death(3, "") == "failed: no message"


VIEW = f"<!-- cdcp_igl: input {'1' * 64} options {'2' * 16} -->\n"  # ends the page of a surface


@pytest.mark.parametrize(
    ("name", "text"), [("summary.csv", "thesis"), ("page.html", "thesis"), ("page.html", VIEW)]
)
def test_summaries_and_reports_of_others_are_not_overwritten(scans, tmp_path, name, text):
    (tmp_path / "maps").mkdir()
    other = tmp_path / "maps" / name
    other.write_text(text)
    done = command(scans, tmp_path / "maps", "--report", tmp_path / "maps" / "page.html")
    assert done.returncode == 1
    assert f"{other}: is no" in done.stderr
    assert [path.name for path in (tmp_path / "maps").iterdir()] == [name]
    assert other.read_text() == text
