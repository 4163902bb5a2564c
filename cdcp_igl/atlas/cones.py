"""Short slits where they even out the scale: cones, chosen by what they gain.

With u the logarithm of the scale of the map whose boundary keeps its lengths, L_II u = -Omega and
u = 0 on the boundary: what varies the scale is curvature that has to be flattened away. At a cone
it need not be. After Y. Soliman, D. Slepčev, K. Crane. Optimal cone singularities for conformal
flattening. ACM Trans. Graph. 37(4), 2018, who ask for the least total curvature of the cones; here
they are few, as each needs a slit.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.sparse.csgraph import dijkstra

from ..arrays import Floats, Ints, marked
from ..cached import cached_property
from ..maps.boundary_first import curvatures
from ..maps.disk import factored_surface
from ..maps.free import FreeProblem, boundary_of, own_outline
from ..maps.problem import solve
from ..options import Options
from ..phases import Phases
from ..result.free_map import FreeMap
from ..solve.factored import FactoredSurface
from ..surface.triangles import face_areas, vertex_areas
from ..verdict.outline import OutlineCertificate
from ..verdict.texels import variation
from .cut_graph import OpenedComponent
from .cut_paths import branch_to
from .parting import LEAST_FACES

MOST_CONES = 16  # in one round


@dataclass(frozen=True, eq=False)
class Draft:
    """A component that is opened to a disk, with its factor: what its free outline would be."""

    opened: OpenedComponent
    options: Options
    phase: Phases = field(default_factory=Phases)
    _plain: dict[str, FreeMap] = field(default_factory=dict, init=False)  # maps by the Laplacian

    @cached_property
    def surface(self) -> FactoredSurface:
        """The disk, factored."""
        return factored_surface(self.opened.positions, self.opened.F, self.options, self.phase)

    @cached_property
    def area(self) -> Floats:
        """(n,) share of each vertex in the area, without what fills holes."""
        given = self.opened.F[: len(self.opened.component.rows)]
        area = vertex_areas(self.opened.positions, given)
        return area / area.sum()

    @cached_property
    def factor(self) -> Floats:
        """(n,) logarithm of the scale less its mean over the area."""
        return self._centred(self.surface.solve(-curvatures(self.surface.mesh)))

    @cached_property
    def scale_variation(self) -> float:
        """Standard deviation of the factor."""
        return variation(self.factor, self.area)

    @cached_property
    def outline(self) -> OutlineCertificate:
        """Where the outline overlaps itself, if it does."""
        return own_outline(self.surface, self.phase)

    @cached_property
    def distance(self) -> Floats:
        """(n,) how far each vertex is from the boundary, along edges that can be cut."""
        graph = self.opened.graph(self.opened.component.length)
        boundary = np.flatnonzero(self.opened.on_boundary)
        return np.asarray(dijkstra(graph, indices=boundary, min_only=True), np.float64)

    @property
    def is_small(self) -> bool:
        """Whether it has so few faces that it is not parted to even out the scale."""
        return len(self.opened.component.rows) < LEAST_FACES

    @property
    def seams(self) -> float:
        """Length of the cut by the square root of the area."""
        return seams(self.opened)

    def cones(self, wanted: float) -> Ints:
        """Choose vertices at which curvature may stay, so that the scale varies no more than that.

        Each is where a change of curvature lowers the sum of squares fastest; then the curvatures
        of all are chosen anew, by least squares. Two solves each.
        """
        chosen, columns, left = list[int](), list[Floats](), self.factor
        weight = np.sqrt(self.area)
        within = np.isfinite(self.distance)
        while self.area @ left**2 > wanted**2 and len(chosen) < MOST_CONES:
            gain = abs(self.surface.solve(self.area * left)) * within
            cone = int(gain.argmax())
            if cone in chosen or gain[cone] == 0:
                break
            chosen.append(cone)
            at_cone = marked(len(left), cone).astype(np.float64)
            columns.append(self._centred(self.surface.solve(at_cone)))
            A = np.array(columns) * weight
            curvature = np.linalg.lstsq(A.T, weight * self.factor, rcond=None)[0]
            left = self.factor - curvature @ np.array(columns)
        return np.array(chosen, np.int64)

    def slit(self, wanted: float) -> Draft:
        """Cut from the boundary to each cone, to the nearest first."""
        opened, cones = self.opened, self.cones(wanted)
        for cone in cones[np.argsort(self.distance[cones], kind="stable")].tolist():
            opened = branch_to(opened, cone)
        return Draft(opened, self.options)

    def map(self, enough: float = np.inf, *, may_ease: bool = True) -> FreeMap:
        """Go on to the map, and refine it if its mean error is more than so many degrees."""
        problem = FreeProblem(
            *(self.surface, boundary_of(self.surface.mesh), self.options, self.phase),
            keep_factor=enough == np.inf,  # there may be another map after this
            enough=enough,
            may_ease=may_ease,
            known=self._plain,
        )
        return solve(problem)

    def _centred(self, u: Floats) -> Floats:
        return u - self.area @ u


def seams(opened: OpenedComponent) -> float:
    """Length of a cut by the square root of the area."""
    V, edges, component = opened.component.V, opened.cut_edges, opened.component
    length = np.linalg.norm(V[component.tail[edges]] - V[component.head[edges]], axis=1).sum()
    return float(length / np.sqrt(face_areas(V, component.F[: len(component.rows)]).sum()))
