import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray


@pytest.fixture(scope="session")
def real_mesh() -> Callable[[str], tuple[NDArray[np.float64], NDArray[np.int32]]]:
    """Load NAME.npz from the directory CDCP_IGL_DATA; skip, or fail if data are required."""

    def load(name: str) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        directory = os.environ.get("CDCP_IGL_DATA")
        path = Path(directory or "") / f"{name}.npz"
        if not directory or not path.is_file():
            missing = pytest.fail if os.environ.get("CDCP_IGL_REQUIRE_DATA") == "1" else pytest.skip
            missing(f"{path.name} is not in CDCP_IGL_DATA ({directory})")
        with np.load(path) as arrays:
            return arrays["V"], arrays["F"]

    return load
