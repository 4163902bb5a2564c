"""The estimate of memory, what there is of it, and 64-bit indices."""

import math

import meshes
import numpy as np
import pytest

import cdcp_igl
from cdcp_igl.solve import memory
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.surface.mesh import DiskMesh

V, F = meshes.grid(20, 30)


@pytest.fixture
def system(tmp_path, monkeypatch):
    """A system of which nothing is known; returns what writes a file of it."""
    monkeypatch.setattr(memory, "PROC", tmp_path / "proc")
    monkeypatch.setattr(memory, "CGROUP", tmp_path / "cgroup")

    def write(name, text):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    return write


def test_a_system_that_does_not_tell(system, monkeypatch):
    assert memory.available_memory() == math.inf
    monkeypatch.setattr(memory, "UNQUESTIONED", 0)
    assert cdcp_igl.disk_map(V, F).certificate.valid


def test_what_the_machine_has(system):
    system("proc/meminfo", "MemTotal:  9000 kB\nMemAvailable:  4000 kB\nSwapFree: 1 kB\n")
    assert memory.available_memory() == 4000 * 1024


@pytest.mark.parametrize(
    ("limit", "use", "account", "inactive"), memory.CONTAINERS, ids=["version 2", "version 1"]
)
def test_what_a_container_has(system, limit, use, account, inactive):
    system("proc/meminfo", "MemAvailable:  4000 kB\n")
    system(f"cgroup/{limit}", "3000000\n")
    system(f"cgroup/{use}", "2000000\n")
    system(f"cgroup/{account}", f"anon 7\n{inactive} 500000\n")
    assert memory.available_memory() == 1_500_000
    system(f"cgroup/{limit}", "max\n")
    assert memory.available_memory() == 4000 * 1024


@pytest.mark.parametrize("way", ["cdcp", "disk_map", "mapper"])
def test_too_little_memory_is_an_error_before_the_work(system, monkeypatch, way):
    system("proc/meminfo", "MemAvailable:  100 kB\n")
    assert cdcp_igl.disk_map(V, F).certificate.valid  # nobody asks for so few vertices
    monkeypatch.setattr(memory, "UNQUESTIONED", 0)
    monkeypatch.setattr("cdcp_igl.solve.factor.Cholesky", None)
    run = {"cdcp": cdcp_igl.cdcp, "disk_map": cdcp_igl.disk_map, "mapper": cdcp_igl.DiskMapper}
    with pytest.raises(cdcp_igl.SolverError, match=r"600 vertices .* GiB .* Decimate the mesh"):
        run[way](V, F)


def test_a_limit_of_the_address_space(system, monkeypatch):
    resource = pytest.importorskip("resource")
    limit = [10 * 2**30]
    monkeypatch.setattr(resource, "getrlimit", lambda _: (limit[0], limit[0]))
    system("proc/self/status", f"VmSize:  {9 * 2**20} kB\n")
    memory.require_memory(1_000_000)
    with pytest.raises(cdcp_igl.SolverError, match=r"at least 1\.8 GiB more, and 1\.0 GiB"):
        memory.require_memory(2_000_000)
    limit[0] = resource.RLIM_INFINITY
    memory.require_memory(2_000_000)


@pytest.mark.parametrize("side", [100, 200])
def test_the_factor_has_as_many_entries_as_estimated(side):
    cholmod = pytest.importorskip("sksparse.cholmod")
    if not hasattr(cholmod, "analyze"):
        pytest.skip("scikit-sparse 0.5 does not show its factor")
    mesh = DiskMesh(*meshes.grid(side, side))
    A = cotangent_laplacian(mesh).block(mesh.interior)
    entries = cholmod.cholesky(A, mode="supernodal", ordering_method="amd").L().nnz
    assert 0.5 < entries / memory.factor_entries(len(mesh.V)) < 2


def test_64_bit_indices_where_32_do_not_suffice(monkeypatch):
    solver = pytest.importorskip("cdcp_igl.solve.with_scikit_sparse")
    short = cdcp_igl.disk_map(V, F, refine=2, solver="scikit-sparse")
    monkeypatch.setattr(solver, "ENTRIES_OF_32_BITS", 0)
    mesh = DiskMesh(V, F)
    A = cotangent_laplacian(mesh).block(mesh.interior)
    assert solver.Factorization(A, False).permutation.dtype == np.int64
    assert A.indices.dtype == np.int32
    long = cdcp_igl.disk_map(V, F, refine=2, solver="scikit-sparse")
    np.testing.assert_allclose(long.uv, short.uv, atol=1e-12)
    moved = cdcp_igl.DiskMapper(V, F, solver="scikit-sparse").moved(2 * np.asarray(V)).map()
    np.testing.assert_allclose(moved.uv, cdcp_igl.cdcp(V, F), atol=1e-12)
