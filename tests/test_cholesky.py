from copy import copy
from ctypes import CDLL
from threading import Event, Thread

import numpy as np
import pytest
import scipy.sparse as sp
from threadpoolctl import ThreadpoolController, threadpool_info, threadpool_limits

from cdcp_igl import disk_map
from cdcp_igl.datasets import spherical_cap
from cdcp_igl.errors import SolverError
from cdcp_igl.solve.solvers import SOLVERS, VARIABLE, factorize, solver
from cdcp_igl.solve.threads import one_thread

RNG = np.random.default_rng(0)
ORDERING = ["scikit-sparse", "cvxopt"]


@pytest.fixture(autouse=True, params=[*SOLVERS, "scikit-sparse, supernodal"])
def name(request, monkeypatch):
    name, _, supernodal = request.param.partition(", ")
    if supernodal:
        monkeypatch.setattr("cdcp_igl.solve.with_scikit_sparse.SUPERNODAL", 0)
    monkeypatch.setenv(VARIABLE, name)
    return name


@pytest.fixture
def A():
    B = sp.random(40, 40, 0.1, random_state=1)
    return (B @ B.T + 40 * sp.identity(40)).tocsc()


@pytest.mark.parametrize("ordering", ["amd", "natural"])
@pytest.mark.parametrize("shape", [(40,), (40, 2)])
def test_solve(A, ordering, shape):
    b = RNG.normal(size=shape)
    np.testing.assert_allclose(A @ factorize(A, ordering).solve(b), b, atol=1e-12)


def test_a_complex_vector_is_solved_in_its_two_parts(A):
    b, factor = RNG.normal(size=(40, 2)), factorize(A)
    expected = factor.solve(np.asfortranarray(b)) @ [1, 1j]
    np.testing.assert_array_equal(factor.solve(b @ [1, 1j]), expected)


@pytest.mark.parametrize("ordering", ["amd", "natural"])
def test_refactoring_keeps_the_permutation(A, ordering):
    factor = factorize(A, ordering)
    before, other = factor.permutation.copy(), A.copy()
    other.data = other.data * np.where(other.data > 40, 2, -0.5)
    factor.refactor(other)
    b = RNG.normal(size=(40, 2))
    np.testing.assert_allclose(other @ factor.solve(b), b, atol=1e-12)
    np.testing.assert_array_equal(factor.permutation, before)
    with pytest.raises(SolverError, match="size 40"):
        factor.refactor(-other)
    factor.refactor(A)
    np.testing.assert_allclose(A @ factor.solve(b), b, atol=1e-12)


def test_both_factorizations_are_kept(A):
    b = np.ones(40)
    one = factorize(A, "natural")
    other = copy(one)
    other.refactor(2 * A)
    np.testing.assert_array_equal(other.permutation, one.permutation)
    np.testing.assert_allclose(other.solve(b), one.solve(b) / 2, rtol=1e-12)
    np.testing.assert_allclose(A @ one.solve(b), b, atol=1e-12)
    other.refactor(3 * A)
    np.testing.assert_allclose(A @ one.solve(b), b, atol=1e-12)


@pytest.mark.parametrize("index", [np.int32, np.int64])
def test_a_read_only_matrix_with_unsorted_indices(A, index):
    A.indices, A.indptr = A.indices.astype(index), A.indptr.astype(index)
    shuffled, b = A[:, ::-1][:, ::-1].copy(), RNG.normal(size=(40, 2))
    arrays = shuffled.data, shuffled.indices, shuffled.indptr, b
    kept = [array.copy() for array in arrays]
    for array in arrays:
        array.flags.writeable = False
    factor = factorize(shuffled)
    factor.refactor(shuffled)
    np.testing.assert_allclose(A @ factor.solve(b), b, atol=1e-12)
    assert sorted(solver().fill_reducing_order(shuffled)) == list(range(40))
    for array, before in zip(arrays, kept, strict=True):
        np.testing.assert_array_equal(array, before)


def test_only_the_lower_triangle_is_read(A):
    b = np.ones(40)
    lower = sp.tril(A, format="csc")
    x = factorize(lower).solve(b)
    np.testing.assert_allclose(A @ x, b, atol=1e-12)
    more = (lower + 7 * sp.triu(A, 1)).tocsc()
    np.testing.assert_array_equal(factorize(more).solve(b), x)


@pytest.mark.parametrize("name", ORDERING, indirect=True)
def test_order_is_a_permutation_that_saves_fill():
    n = 30
    arrow = sp.lil_matrix(2 * n * sp.identity(n))
    arrow[0, :], arrow[:, 0] = 1, 1
    arrow[0, 0] = 2 * n
    order = solver().fill_reducing_order(arrow.tocsc())
    assert sorted(order) == list(range(n))
    assert list(order).index(0) >= n - 2  # the dense row comes last


@pytest.mark.parametrize(
    "matrix", [[[1.0, 2.0], [2.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]], [[-1.0, 0.0], [0.0, 1.0]]]
)
def test_indefinite_matrix_is_a_solver_error(matrix, name):
    with pytest.raises(SolverError, match=rf"{name} .* size 2.*slivers"):
        factorize(sp.csc_matrix(matrix)).solve(np.ones(2))


def openmp() -> list[CDLL]:
    pools = ThreadpoolController().lib_controllers
    return [pool.dynlib for pool in pools if pool.user_api == "openmp"]


def settings() -> list[tuple[int, ...]]:
    """What the caller has set: the threads of all libraries, the levels of OpenMP."""
    levels = tuple(runtime.omp_get_max_active_levels() for runtime in openmp())
    return [tuple(pool["num_threads"] for pool in threadpool_info()), levels]


@pytest.mark.parametrize("sign", [1, -1])
def test_the_callers_settings_are_back(A, sign):
    """Also after an error."""
    factorize(A)  # loads the libraries
    with threadpool_limits(2):
        before = settings()
        try:
            factorize(sign * A).solve(np.ones(40))
        except SolverError:
            assert sign == -1
        assert settings() == before


def test_a_whole_map_is_on_one_thread():
    factorize(sp.identity(2))
    seen: list[list[tuple[int, ...]]] = []
    V, F, _ = spherical_cap(5)
    with threadpool_limits(2):
        before = settings()
        disk_map(V, F, progress=lambda *done: seen.append(settings()))
        assert settings() == before
    assert seen
    assert {number for seen_by in seen for numbers in seen_by for number in numbers} <= {0, 1}


def test_nothing_is_parallel_in_bodies_that_overlap():
    """Of another thread than that which set the limit; the first to enter is the first to leave."""
    entered, overlap, left = Event(), Event(), Event()

    def other():
        with one_thread():
            seen.append(settings())
            entered.set()
            overlap.wait()
        left.set()

    seen: list[list[tuple[int, ...]]] = []
    thread = Thread(target=other)
    with threadpool_limits(2):
        before = settings()
        thread.start()
        entered.wait()
        with one_thread():
            overlap.set()
            left.wait()
            seen.append(settings())
        thread.join()
        assert settings() == before
    assert {number for seen_by in seen for numbers in seen_by for number in numbers} <= {0, 1}
