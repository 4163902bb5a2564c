"""Real meshes for the tests, from the directory in CDCP_IGL_DATA."""

import os
from collections.abc import Callable
from pathlib import Path

import hypothesis
import numpy as np
import pytest

# Deterministic: a failure in CI is a failure everywhere.
hypothesis.settings.register_profile("cdcp_igl", derandomize=True, deadline=None)
hypothesis.settings.load_profile("cdcp_igl")

# It is run by the interpreters of workers, and Debian has one of this name.
collect_ignore = ["workers/sitecustomize.py"]

Mesh = tuple[np.ndarray, np.ndarray]


def pytest_collection_modifyitems(items):
    """What maps a real surface, drives a browser or starts many processes is slow."""
    for item in items:
        if "real_mesh" in item.fixturenames or "driver" in item.fixturenames:
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def real_mesh() -> Callable[[str], Mesh]:
    def load(name: str) -> Mesh:
        path = Path(os.environ.get("CDCP_IGL_DATA", "")) / f"{name}.npz"
        if not path.exists():
            if os.environ.get("CDCP_IGL_REQUIRE_DATA") == "1":
                pytest.fail(f"{path} is missing and CDCP_IGL_REQUIRE_DATA=1")
            pytest.skip(f"set CDCP_IGL_DATA to a directory with {name}.npz")
        with np.load(path) as data:
            return data["V"], data["F"]

    return load
