"""Names of the array types used in signatures."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["Bools", "Complex", "Floats", "Ints"]

Bools = NDArray[np.bool_]
Complex = NDArray[np.complex128]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
