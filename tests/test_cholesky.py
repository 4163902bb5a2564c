import numpy as np
import pytest
import scipy.sparse as sp
from threadpoolctl import threadpool_info, threadpool_limits

import cdcp_igl.solve.threads
from cdcp_igl.errors import SolverError
from cdcp_igl.solve.cholesky import Cholesky, fill_reducing_order
from cdcp_igl.solve.solvers import SOLVERS, solver, using
from cdcp_igl.solve.threads import one_thread

RNG = np.random.default_rng(0)


ORDERING = ["scikit-sparse", "cvxopt"]


@pytest.fixture(autouse=True, params=SOLVERS)
def name(request):
    with using(request.param):
        yield request.param


@pytest.fixture
def A():
    B = sp.random(40, 40, 0.1, random_state=1)
    return (B @ B.T + 40 * sp.identity(40)).tocsc()


@pytest.mark.parametrize("ordering", ["amd", "natural"])
@pytest.mark.parametrize("shape", [(40,), (40, 2)])
def test_solve(A, ordering, shape):
    b = RNG.normal(size=shape)
    np.testing.assert_allclose(A @ Cholesky(A, ordering).solve(b), b, atol=1e-12)


def test_a_complex_vector_is_solved_in_its_two_parts(A):
    b, factor = RNG.normal(size=(40, 2)), Cholesky(A)
    expected = factor.solve(np.asfortranarray(b)) @ [1, 1j]
    np.testing.assert_array_equal(factor.solve(b @ [1, 1j]), expected)


@pytest.mark.parametrize("ordering", ["amd", "natural"])
def test_refactoring_keeps_the_permutation(A, ordering):
    factor = Cholesky(A, ordering)
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


def test_inputs_are_not_modified(A):
    shuffled = A[:, ::-1][:, ::-1].copy()  # same matrix, row indices unsorted
    data, indices, b = shuffled.data.copy(), shuffled.indices.copy(), RNG.normal(size=(40, 2))
    kept = b.copy()
    factor = Cholesky(shuffled)
    factor.solve(b)
    np.testing.assert_array_equal(shuffled.data, data)
    np.testing.assert_array_equal(shuffled.indices, indices)
    np.testing.assert_array_equal(b, kept)


def test_a_read_only_matrix(A):
    for array in (A.data, A.indices, A.indptr):
        array.flags.writeable = False
    factor = Cholesky(A)
    factor.refactor(A)
    np.testing.assert_allclose(A @ factor.solve(np.ones(40)), np.ones(40), atol=1e-12)
    assert sorted(fill_reducing_order(A)) == list(range(40))


@pytest.mark.parametrize("name", ORDERING, indirect=True)
def test_order_is_a_permutation_that_saves_fill():
    n = 30
    arrow = sp.lil_matrix(2 * n * sp.identity(n))
    arrow[0, :], arrow[:, 0] = 1, 1
    arrow[0, 0] = 2 * n
    order = fill_reducing_order(arrow.tocsc())
    assert sorted(order) == list(range(n))
    assert list(order).index(0) >= n - 2  # the dense row comes last


@pytest.mark.parametrize(
    "matrix", [[[1.0, 2.0], [2.0, 1.0]], [[1.0, 1.0], [1.0, 1.0]], [[-1.0, 0.0], [0.0, 1.0]]]
)
def test_indefinite_matrix_is_a_solver_error(matrix, name):
    with pytest.raises(SolverError, match=rf"{name} .* size 2.*slivers"):
        Cholesky(sp.csc_matrix(matrix)).solve(np.ones(2))


@pytest.mark.parametrize("index", [np.int32, np.int64])
def test_indices_of_32_and_64_bits(A, index):
    A.indices, A.indptr = A.indices.astype(index), A.indptr.astype(index)
    np.testing.assert_allclose(A @ Cholesky(A).solve(np.ones(40)), np.ones(40), atol=1e-12)
    assert sorted(fill_reducing_order(A)) == list(range(40))


def test_no_memory_is_a_solver_error(A, monkeypatch):
    def full(*arguments):
        raise MemoryError

    monkeypatch.setattr(solver(), "Factorization", full)
    with pytest.raises(SolverError, match="memory"):
        Cholesky(A)


def test_both_factorizations_are_kept(A):
    b = np.ones(40)
    one = Cholesky(A, "natural")
    other = one.refactored(2 * A)
    np.testing.assert_allclose(other.solve(b), one.solve(b) / 2, rtol=1e-12)
    np.testing.assert_allclose(A @ one.solve(b), b, atol=1e-12)


def test_callers_thread_setting_is_restored(A):
    with threadpool_limits(2):
        before = [pool["num_threads"] for pool in threadpool_info()]
        Cholesky(A).solve(np.ones(40))
        assert [pool["num_threads"] for pool in threadpool_info()] == before


def test_calls_that_overlap_in_threads_restore_the_callers_setting():
    """The first to enter is the first to leave, as two threads may do."""

    def threads():
        return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]

    with threadpool_limits(2, "blas"):
        before = threads()
        one, other = one_thread(), one_thread()
        one.__enter__()
        other.__enter__()
        one.__exit__(None, None, None)
        assert set(threads()) == {1}
        other.__exit__(None, None, None)
        assert threads() == before


class Runtime:
    """Stands for an OpenMP library and keeps what it was told."""

    def __init__(self):
        self.levels = [3]

    def omp_get_max_active_levels(self):
        return self.levels[-1]

    def omp_set_max_active_levels(self, level):
        self.levels.append(level)


def test_openmp_loops_are_serial_and_the_callers_setting_is_restored(A, monkeypatch):
    factor = Cholesky(A)  # loads the solver, after which the libraries are looked for again
    runtime = Runtime()
    monkeypatch.setattr(cdcp_igl.solve.threads, "_OPENMP", [runtime])
    factor.solve(np.ones(40))
    assert runtime.levels == [3, 0, 3]
    with pytest.raises(SolverError):
        factor.refactor(-A)
    assert runtime.levels[-1] == 3


def test_libraries_may_be_loaded_meanwhile(monkeypatch):
    """As by another thread, whose solver is another one."""
    before, after = Runtime(), Runtime()
    monkeypatch.setattr(cdcp_igl.solve.threads, "_OPENMP", [before])
    with one_thread():
        monkeypatch.setattr(cdcp_igl.solve.threads, "_OPENMP", [before, after])
    assert (before.levels, after.levels) == ([3, 0, 3], [3])


def test_only_the_lower_triangle_is_read(A):
    b = np.ones(40)
    lower = sp.tril(A, format="csc")
    x = Cholesky(lower).solve(b)
    np.testing.assert_allclose(A @ x, b, atol=1e-12)
    more = (lower + 7 * sp.triu(A, 1)).tocsc()
    np.testing.assert_array_equal(Cholesky(more).solve(b), x)
