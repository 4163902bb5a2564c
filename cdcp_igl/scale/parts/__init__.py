"""One surface in parts: larger than memory, on one machine or many, and the same map.

The faces are parted by planes. Each part is condensed to its seams, these are eliminated in the
order of the planes, dense, and what is inside the parts follows from its seam: substructuring. All
that is computed is a file in the folder of the parts, so that any process may compute it, and a
run that was stopped goes on.

References
----------
J. S. Przemieniecki. Matrix structural analysis of substructures. AIAA Journal 1(1), 1963.
"""

from .mapping import parts_map
from .parting import partition
from .result import PartsMap

__all__ = ["PartsMap", "partition", "parts_map"]
