"""Systems and packages: what Windows lacks, how much memory there is, what packages say."""

import json
import math
import re
import tomllib
from pathlib import Path

import meshes
import numpy as np
import pytest
import yaml
from commands import start

import cdcp_igl
from cdcp_igl.solve import memory
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.surface.mesh import DiskMesh

WITHOUT = """
import sys
for name in ("resource", "fcntl", "termios", "tty", "pwd", "grp", "pty"):
    sys.modules[name] = None
import os
for name in ("chown", "getuid", "geteuid", "mkfifo", "fork", "O_NONBLOCK", "killpg", "getpgid"):
    delattr(os, name)
import shutil
shutil._use_fd_functions = False  # as there; else rmtree asks for O_NONBLOCK
"""

IMPORT_ALL = """
import importlib, json, pkgutil
import cdcp_igl
names = [m.name for m in pkgutil.walk_packages(cdcp_igl.__path__, "cdcp_igl.")]
for name in names:
    if not name.endswith("__main__"):
        importlib.import_module(name)
print(json.dumps(names))
"""

MAP = """
from cdcp_igl import datasets, disk_map
from cdcp_igl.io import read_mesh, write_map
V, F, _ = datasets.spherical_cap(6)
from concurrent.futures import ThreadPoolExecutor
from cdcp_igl import batch
for name in ("a.npz", "a.obj", "a.glb", "a.obj"):
    write_map(name, V, F, disk_map(V, F))
assert (read_mesh("a.npz")[0] == V).all()
assert len(batch("a.npz", "maps", executor=ThreadPoolExecutor(1)).done) == 1
print(sorted(os.listdir()))
"""


def test_every_module_is_imported_and_maps_are_made_and_written(tmp_path):
    done = start("-c", WITHOUT + IMPORT_ALL + MAP, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    names, files = done.stdout.splitlines()
    assert "cdcp_igl.solve.with_cvxopt" in json.loads(names)
    assert files == "['a.glb', 'a.npz', 'a.obj', 'maps']"


# -- memory: its estimate, what there is of it, 64-bit indices -------------------------


@pytest.fixture
def system(tmp_path):
    """What writes a file of a system of which nothing else is known."""

    def write(name, text):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    return write


def test_a_system_that_does_not_tell(tmp_path):
    assert memory.available_memory(tmp_path) == math.inf


def test_what_the_machine_has(system, tmp_path):
    system("proc/meminfo", "MemTotal:  9000 kB\nMemAvailable:  4000 kB\nSwapFree: 1 kB\n")
    assert memory.available_memory(tmp_path) == 4000 * 1024


def test_what_a_container_has(system, tmp_path):
    system("proc/meminfo", "MemAvailable:  4000 kB\n")
    system("sys/fs/cgroup/memory.max", "3000000\n")
    system("sys/fs/cgroup/memory.current", "2000000\n")
    system("sys/fs/cgroup/memory.stat", "anon 7\ninactive_file 500000\n")
    assert memory.available_memory(tmp_path) == 1_500_000
    system("sys/fs/cgroup/memory.max", "max\n")
    assert memory.available_memory(tmp_path) == 4000 * 1024


@pytest.fixture
def limit_address_space():
    """What leaves this process so many more bytes of address space, until the test ends."""
    resource = pytest.importorskip("resource")
    if not Path("/proc/self/status").exists():
        pytest.skip("this system does not tell how much is in use")
    before = resource.getrlimit(resource.RLIMIT_AS)

    def limit(room):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + room, before[1]))

    yield limit
    resource.setrlimit(resource.RLIMIT_AS, before)


def test_a_limit_of_the_address_space(limit_address_space):
    limit_address_space(2**30)
    memory.require_memory(1_000_000)
    with pytest.raises(cdcp_igl.SolverError, match=r"at least 1\.8 GiB more, and 1\.0 GiB"):
        memory.require_memory(2_000_000)


def test_too_little_memory_is_an_error_before_the_work(limit_address_space):
    V, F, _ = cdcp_igl.datasets.square(160)

    def progress(phase, fraction):
        if phase == "factor":
            limit_address_space(2**26)

    expected = r"103,041 vertices takes at least 0\.1 GiB more, .* in parts"
    with pytest.raises(cdcp_igl.SolverError, match=expected):
        cdcp_igl.disk_map(V, F, progress=progress)


def test_too_little_memory_to_say_what_is_wrong(limit_address_space, tmp_path):
    limit_address_space(2**26)
    with pytest.raises(cdcp_igl.SolverError, match=r"no triangulated disk.* at least 0\.1 GiB"):
        cdcp_igl.partition((np.zeros((200_000, 3)), np.zeros((5, 2))), tmp_path / "parts")


@pytest.mark.parametrize("side", [100, 200])
def test_the_factor_has_as_many_entries_as_estimated(side):
    solver = pytest.importorskip("cdcp_igl.solve.with_scikit_sparse")
    cholmod = solver.cholmod
    if not hasattr(cholmod, "analyze"):
        pytest.skip("scikit-sparse 0.5 analyses in another way")
    mesh = DiskMesh(*meshes.grid(side, side))
    A = cotangent_laplacian(mesh).block(mesh.interior)
    entries = cholmod.cholesky(A, mode="supernodal", ordering_method="amd").L().nnz
    assert 0.5 < entries / solver.factor_entries(len(mesh.scaled)) < 2


def test_64_bit_indices_where_32_do_not_suffice(monkeypatch):
    """A surface that needs them takes 16 GB, so the limit is lowered here."""
    solver = pytest.importorskip("cdcp_igl.solve.with_scikit_sparse")
    V, F = meshes.grid(20, 30)
    short = cdcp_igl.disk_map(V, F, refine=2, solver="scikit-sparse")
    monkeypatch.setattr(solver, "ENTRIES_OF_32_BITS", 0)
    mesh = DiskMesh(V, F)
    A = cotangent_laplacian(mesh).block(mesh.interior)
    assert solver.Factorization(A).permutation.dtype == np.int64
    assert A.indices.dtype == np.int32
    long = cdcp_igl.disk_map(V, F, refine=2, solver="scikit-sparse")
    np.testing.assert_allclose(long.uv, short.uv, atol=1e-12)
    moved = cdcp_igl.DiskMapper(V, F, solver="scikit-sparse").moved(2 * np.asarray(V)).map()
    np.testing.assert_allclose(moved.uv, cdcp_igl.cdcp(V, F), atol=1e-12)


# -- packages --------------------------------------------------------------------------


ROOT = Path(__file__).parents[1]
# As conda-forge calls them: libigl is its C++ library there, matplotlib brings a desktop toolkit.
CONDA_NAMES = {"libigl": "igl", "matplotlib": "matplotlib-base"}


@pytest.fixture(scope="module")
def project():
    return tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))


@pytest.fixture(scope="module")
def recipe():
    """The recipe of the conda package, its variables filled in."""
    text = (ROOT / "recipe" / "recipe.yaml").read_text("utf-8")
    values = yaml.safe_load(text)["context"]
    return yaml.safe_load(
        re.sub(r"\$\{\{ (\w+) \}\}", lambda match: values.get(match[1], match[0]), text)
    )


def test_the_version_is_the_same_everywhere(recipe):
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert citation["version"] == cdcp_igl.__version__
    assert recipe["package"]["version"] == cdcp_igl.__version__
    assert cdcp_igl.__version__ in (ROOT / "CHANGELOG.md").read_text("utf-8")


def test_nothing_under_the_gpl_is_installed_unasked(project):
    needed = {requirement.split()[0] for requirement in project["project"]["dependencies"]}
    extras = project["project"]["optional-dependencies"]
    assert {"cvxopt", "scikit-sparse"} < set(extras)
    assert not needed & {"cvxopt", "scikit-sparse"}


def test_the_conda_package_needs_what_the_wheel_needs(project, recipe):
    extras = project["project"]["optional-dependencies"]
    wanted = [*project["project"]["dependencies"], *extras["cli"], *extras["data"], *extras["plot"]]
    expected = {f"python {project['project']['requires-python']}"}
    for requirement in wanted:
        name, bound = requirement.split(" ", 1)
        expected.add(f"{CONDA_NAMES.get(name, name)} {bound.replace(' ', '')}")
    assert set(recipe["requirements"]["run"]) == expected
    assert set(project["build-system"]["requires"]) < set(recipe["requirements"]["host"])
