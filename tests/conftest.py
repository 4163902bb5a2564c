"""Real meshes for the tests, from the directory in CDCP_IGL_DATA or from where they are public."""

import os
import re
import signal
from collections.abc import Callable
from functools import cache
from pathlib import Path

import hypothesis
import numpy as np
import pytest
from batches import write_surfaces

from cdcp_igl import DiskMap, datasets, disk_map
from cdcp_igl.reference import case

# Deterministic: a failure in CI is a failure everywhere.
hypothesis.settings.register_profile("cdcp_igl", derandomize=True, deadline=None)
hypothesis.settings.load_profile("cdcp_igl")

# Signals ignored here, as in a job in the background, would be in the programs that tests start.
for name, handler in {"SIGINT": signal.default_int_handler, "SIGHUP": signal.SIG_DFL}.items():
    number = getattr(signal, name, None)
    if number is not None and signal.getsignal(number) == signal.SIG_IGN:
        signal.signal(number, handler)

# It is run by the interpreters of workers, and Debian has one of this name.
collect_ignore = ["workers/sitecustomize.py"]

Mesh = tuple[np.ndarray, np.ndarray]


# Files whose tests start processes, or map and draw many surfaces in a row.
MANY_PROCESSES = (
    *("test_batch_workers", "test_benchmarks"),
    *("test_cli_processes", "test_compare", "test_docs"),
)


def pytest_collection_modifyitems(items):
    """What maps a real surface, drives a browser or starts many processes is slow."""
    for item in items:
        fixtures = {"real_mesh", "browser"}.intersection(item.fixturenames)
        if fixtures or item.path.stem.startswith(MANY_PROCESSES):
            item.add_marker(pytest.mark.slow)


def public_name(name: str) -> str | None:
    """What `datasets` calls a mesh, whose name may stand without its size there."""
    names = Path(name).name, re.sub(r"_\d+(_ears)?$", "", Path(name).name)
    return next((known for known in names if known in datasets.NAMES), None)


@pytest.fixture
def scans(tmp_path):
    """A folder with three small disks."""
    return write_surfaces(tmp_path / "scans", 3)


@pytest.fixture
def cases_in_this_process(monkeypatch):
    """Methods that are compared run here, where the tables of what they made are the matter."""

    def run(method, V, F, *, table="cdcp_igl.reference:METHODS", **limits):
        return case._Run(method, V, F, table).run()

    for module in ("cdcp_igl.reference.comparison", "benchmarks.measure.cases"):
        monkeypatch.setattr(f"{module}.run_case", run)


@pytest.fixture(scope="session")
def real_mesh() -> Callable[[str], Mesh]:
    unreachable = []

    def public(name: str) -> Mesh:
        found = public_name(name)
        if not found:
            pytest.skip(
                f"{name} is not public: set CDCP_IGL_DATA to a directory that has it; "
                "docs/reference/datasets.md says what it is made of"
            )
        if unreachable:  # each try takes long
            pytest.skip(unreachable[0])
        try:
            return datasets.load(found)
        except (OSError, ImportError) as error:
            unreachable.append(str(error))
            pytest.skip(str(error))

    def load(name: str) -> Mesh:
        if not os.environ.get("CDCP_IGL_DATA"):
            return public(name)
        path = Path(os.environ["CDCP_IGL_DATA"]) / f"{name}.npz"
        if not path.exists():
            if os.environ.get("CDCP_IGL_REQUIRE_DATA") == "1":
                pytest.fail(f"{path} is missing and CDCP_IGL_REQUIRE_DATA=1")
            pytest.skip(f"{path} is missing")
        with np.load(path) as data:
            return data["V"], data["F"]

    return load


@pytest.fixture(scope="session")
def map_of(real_mesh) -> Callable[..., DiskMap]:
    """What maps a real surface with some options, once for all tests that look at the map."""
    return cache(lambda name, **options: disk_map(*real_mesh(name), **options))
