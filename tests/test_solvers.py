"""The same maps by each solver, and how one is chosen."""

import os
import pickle
import sys
import threading

import numpy as np
import pytest
from commands import printed

from cdcp_igl import DiskMapper, datasets, disk_map
from cdcp_igl.solve.solvers import SOLVERS, solver, using

LIBRARIES = {"scikit-sparse": "CHOLMOD", "cvxopt": "CHOLMOD", "scipy": "SuperLU"}
CAP = datasets.spherical_cap(4)[:2]


@pytest.fixture(params=SOLVERS)
def name(request):
    return request.param


@pytest.mark.parametrize(
    "options", [{"refine": 2}, {"center": "heat", "mobius": "area"}, {"preset": "paper"}]
)
def test_the_same_map_by_each(name, options):
    V, F, _ = datasets.spherical_cap(12)
    V = V + 0.2 * np.sin(3 * V[:, [1, 2, 0]] + [1, 2, 3])  # no symmetry, no ties
    result = disk_map(V, F, solver=name, **options)
    assert result.certificate.valid
    expected = disk_map(V, F, solver="scikit-sparse", **options).uv
    np.testing.assert_allclose(result.uv, expected, atol=1e-7 if options.get("refine") else 1e-9)


def test_the_same_distortion_of_a_scan(name, map_of):
    result, expected = (map_of("chinese_lion_17334", solver=s) for s in (name, "scikit-sparse"))
    assert abs(result.distortion.mean - expected.distortion.mean) < 1e-6


def test_the_result_says_it(name):
    V, F = CAP
    said = disk_map(V, F, solver=name).solver
    assert said.startswith(f"{LIBRARIES[name]} ({name} ")
    assert DiskMapper(V, F, solver=name).map().solver == said
    mapper = pickle.loads(pickle.dumps(DiskMapper(V, F, solver=name)))
    assert mapper.moved(V * [1, 1, 2]).map(center="heat").solver == said


def test_the_variable_chooses_and_the_argument_has_the_last_word(monkeypatch):
    monkeypatch.setenv("CDCP_IGL_SOLVER", "cvxopt")
    assert "cvxopt" in disk_map(*CAP).solver
    assert "scipy" in disk_map(*CAP, solver="scipy").solver
    assert "cvxopt" in disk_map(*CAP).solver
    monkeypatch.setenv("CDCP_IGL_SOLVER", "umfpack")
    with pytest.raises(ValueError, match='solver must be one of "scikit-sparse", "cvxopt"'):
        disk_map(*CAP)
    monkeypatch.setenv("CDCP_IGL_SOLVER", "")  # asks for none
    assert disk_map(*CAP).valid


def test_what_is_asked_for_in_one_thread_is_not_asked_for_in_another(monkeypatch):
    monkeypatch.delenv("CDCP_IGL_SOLVER", raising=False)
    seen = []
    with using("scipy"):
        thread = threading.Thread(target=lambda: seen.append(solver()))
        thread.start()
        thread.join()
        assert solver() is not seen[0]


@pytest.mark.parametrize(
    ("broken", "used"),
    [
        ({"sksparse": "ValueError('numpy.dtype size changed')"}, "cvxopt"),
        ({"sksparse": "ImportError('libcholmod.so')", "cvxopt": "OSError('blas')"}, "scipy"),
    ],
)
def test_solvers_that_cannot_be_imported_are_passed_over(tmp_path, broken, used):
    """Not installed, or built for another NumPy; whoever asks for them is told what to do."""
    for package, error in broken.items():
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text(f"raise {error}\n")
    code = """
        from cdcp_igl import datasets, disk_map
        V, F, _ = datasets.spherical_cap(4)
        print(disk_map(V, F).solver)
        try:
            disk_map(V, F, solver="scikit-sparse")
        except ImportError as error:
            print(error)
    """
    path = os.pathsep.join([str(tmp_path), *sys.path])
    by_itself, asked_for = printed(code, PYTHONPATH=path, CDCP_IGL_SOLVER="")
    assert f"({used} " in by_itself
    assert "pip install scikit-sparse; or take another: cvxopt, scipy." in asked_for
    assert broken["sksparse"].split("'")[1] in asked_for


def test_the_options_of_cvxopt_stay_the_callers():
    from cvxopt import cholmod

    cholmod.options["nmethods"] = 2
    try:
        disk_map(*CAP, solver="cvxopt")
        assert cholmod.options == {"nmethods": 2}
    finally:
        cholmod.options.clear()


def error_in_little_memory(room, setting, name):
    """Factor A with so many MiB of address space left; return the message of the SolverError."""
    code = f"""
        import resource
        import numpy as np, scipy.sparse as sp
        from cdcp_igl import SolverError
        from cdcp_igl.solve.solvers import factorize, solver
        {setting}
        with open("/proc/self/statm") as file:
            used = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + ({room} << 20),) * 2)
        try:
            factorize(A)
        except SolverError as error:
            print(error)
    """
    # The last line, as the library itself may have printed before.
    return printed(code, CDCP_IGL_SOLVER=name, OPENBLAS_NUM_THREADS="1")[-1]


@pytest.mark.skipif(sys.platform != "linux", reason="a limit of address space is needed")
def test_memory_that_is_too_small_is_a_solver_error(name):
    setting = """
        n = 10_000  # the factor of a random graph is nearly full
        ends = np.random.default_rng(0).integers(n, size=(2, 3 * n))
        edges = sp.coo_matrix((np.ones(3 * n), ends), (n, n))
        A = (sp.tril(-(edges + edges.T), -1) + 30 * sp.identity(n)).tocsc()
        solver()  # which brings the buffers of BLAS
    """
    message = error_in_little_memory(96, setting.strip(), name)
    assert message.startswith(f"{LIBRARIES[name]} ({name} ")
    assert "size 10,000" in message
    assert "decimate" in message


@pytest.mark.skipif(sys.platform != "linux", reason="a limit of address space is needed")
def test_no_room_for_the_buffers_of_blas_is_a_solver_error(name):
    """OpenBLAS would try for ever, or end the process."""
    assert "256 MB of address space" in error_in_little_memory(64, "A = sp.identity(3)", name)
