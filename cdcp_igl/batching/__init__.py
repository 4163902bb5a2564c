"""Many surfaces: a run that loses nothing, on one machine or on many."""

from .records import Record
from .runs import Batch, batch

__all__ = ["Batch", "Record", "batch"]
