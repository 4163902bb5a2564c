"""Many surfaces: a run that loses nothing, on one machine or on many."""

from .journal import Record
from .runs import Batch, batch

__all__ = ["Batch", "Record", "batch"]
