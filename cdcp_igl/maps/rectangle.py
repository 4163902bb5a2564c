"""A disk with four corners, mapped conformally onto a rectangle."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ellipk, ellipkinc

from ..arrays import Complex, Floats, Ints, marked
from ..cached import cached_property
from ..descent.descent import from_tutte
from ..descent.placing import judged
from ..descent.preconditioning import WeightedLaplacian
from ..descent.repair import repaired
from ..descent.targets import Rectangle
from ..docstrings import like
from ..errors import counted, spell
from ..io.given import takes_meshes, tell
from ..options import Options
from ..phases import Phases, Progress
from ..records import Repair
from ..result.base import announced
from ..result.rectangle_map import RectangleMap
from ..solve.factored import FactoredSurface, harmonic_extension
from ..solve.laplacian import LAPLACIANS, Laplacian
from ..solve.solvers import SolverName, using
from ..starts.tutte import tutte_embedding
from ..surface.filling import split_edges
from ..surface.mesh import DiskMesh, Mesh
from ..verdict.certificate import along_sides, certify_rectangle
from ..verdict.distortion import map_distortion
from .disk import DiskProblem, disk_map
from .problem import OnTarget, Problem, Start, solve

# Phases of a map onto the disk, which a map onto a rectangle has only where its sides cannot slide.
OF_THE_DISK = ("center", "trace", "circle", "extension", "mobius")
REMEDY = "choose corners where the boundary has corners, or refine the faces there"


@takes_meshes
@like(disk_map)
def rectangle_map(
    V: ArrayLike,
    F: ArrayLike,
    corners: ArrayLike,
    *,
    split: bool = False,
    refine: int | None = None,
    refine_norm: float = 1.5,
    refine_seconds: float = np.inf,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> RectangleMap:
    """Map a triangulated disk with four corners conformally onto a rectangle.

    Its width is found with the map, its height is 1. The coordinates are the harmonic
    functions with values 0 and 1 on two opposite sides, whose derivative across the other
    two vanishes; their energies give the modulus and bounds for it. Vertices slide along the
    sides, in refinement, too, which leaves the width free. Where that does not lead to a conformal
    map, the sides are placed as a map onto the disk tells; and where that does not, shear is
    lowered from an embedding that has these sides. The image is a bijection onto the rectangle,
    certified as a map onto the disk is.

    Parameters
    ----------
    corners : (4,) array_like of integers
        Boundary vertices in counterclockwise order (the surface on the left), which go to
        (0, 0), (width, 0), (width, 1) and (0, 1).
    split : bool
        Split edges inside that join two vertices of one side, as those of ears there, at their
        middles; see `RectangleMap.split`. False refuses them.

    Returns
    -------
    RectangleMap

    Raises
    ------
    ValueError
        If the corners are no four boundary vertices in this order, or an edge inside joins
        two vertices of one side, and `split` is False: what it cuts off would become a segment of
        that side.
    MapError
        If no map is a bijection; the one of least distortion is its ``result``.

    References
    ----------
    L. V. Ahlfors. Conformal Invariants. McGraw-Hill, 1973. Chapter 4: the modulus of a
    quadrilateral by Dirichlet's principle.

    Examples
    --------
    >>> import cdcp_igl
    >>> V = [[0, 0], [6, 0], [6, 2], [0, 2], [3, 1]]
    >>> F = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    >>> result = cdcp_igl.rectangle_map(V, F, [0, 1, 2, 3])
    >>> result.valid, round(result.modulus, 12)
    (True, 3.0)
    """
    chosen = np.asarray(corners)
    if chosen.shape != (4,) or chosen.dtype.kind not in "iu":
        raise ValueError(f"corners must be four vertices, not {corners!r}")
    if not isinstance(split, bool):
        raise ValueError(f"split must be True or False, not {split!r}")
    options = Options(
        refine=refine, refine_norm=refine_norm, refine_seconds=refine_seconds, solver=solver
    )
    phase = Phases(progress, refine or 0, skipped=OF_THE_DISK)
    with using(solver):
        with phase("check"):
            mesh = DiskMesh(V, F)
            sides = _boundary_sides(mesh, chosen)
            n, whole, chords = len(mesh.scaled), mesh.F, _chords(mesh, sides, split)
            if len(chords):
                mesh = DiskMesh(*split_edges(mesh.V, mesh.F, chords))
        best = replace(solve(RectangleProblem(mesh, sides, options, phase)), split=chords)
        if len(chords):
            rows = np.append(np.arange(n), [-1] * len(chords)), n
            tell(best, {"given_rows": rows, "given_faces": whole})
    return announced(best)


def _boundary_sides(mesh: Mesh, chosen: Ints) -> list[Ints]:
    """Split the boundary loop: the vertices of each side with its corners, in order."""
    loop_index, nB = mesh.loop_index, len(mesh.loop)
    if not ((chosen >= 0) & (chosen < len(loop_index))).all() or (loop_index[chosen] < 0).any():
        raise ValueError(f"corners={chosen.tolist()} must be boundary vertices")
    starts = loop_index[chosen]
    n_edges = (np.roll(starts, -1) - starts) % nB
    if (n_edges == 0).any() or n_edges.sum() != nB:
        order = mesh.loop[np.sort(starts)].tolist()
        raise ValueError(
            f"corners={chosen.tolist()} must be four vertices in the order of the boundary, "
            f"the surface on the left, which is {order}"
        )
    return [
        mesh.loop[(start + np.arange(count + 1)) % nB]
        for start, count in zip(starts, n_edges, strict=True)
    ]


def _chords(mesh: Mesh, sides: list[Ints], split: bool) -> Ints:
    """(k, 2) edges inside that join two vertices of one side; ValueError unless they are split."""
    found = [mesh.edges.ends(mesh.edges.chords(marked(len(mesh.scaled), side))) for side in sides]
    for number, chords in enumerate(found, 1):
        if len(chords) and not split:
            count = counted(len(chords), "edge inside joins", "edges inside join")
            raise ValueError(
                f"{count} two vertices of side {number}, so that the faces cut off would have no "
                f"area in a rectangle: {spell(chords)}. Choose a corner among these faces, or have "
                "the edges split (split=True, --split)."
            )
    return np.concatenate(found)


@dataclass(frozen=True, eq=False)
class _Square:
    """A map onto the unit square with harmonic coordinates, and what it was made by."""

    f: Complex
    L: Laplacian
    laplacian: str
    boundary: str
    surface: FactoredSurface

    @cached_property
    def energies(self) -> tuple[float, float]:
        """The Dirichlet energies of both coordinates: height by width and width by height.

        Each is at most too large.
        """
        u, v, matrix = self.f.real, self.f.imag, self.L.matrix()
        return float(u @ (matrix @ u)), float(v @ (matrix @ v))

    @property
    def modulus(self) -> float:
        """Width by height."""
        return float(np.sqrt(self.energies[1] / self.energies[0]))

    @property
    def stretched(self) -> Complex:
        """(n,) the map onto the rectangle of this modulus."""
        return self.modulus * self.f.real + 1j * self.f.imag


class RectangleProblem(Problem[RectangleMap]):
    """A disk onto a rectangle, given the vertices of its four sides."""

    onto = " onto the rectangle"
    remedy = "Parts of it may be too small for double precision: choose corners farther apart"

    def __init__(self, mesh: Mesh, sides: list[Ints], options: Options, phase: Phases) -> None:
        super().__init__(mesh, options, phase)
        self.sides = sides
        self._squares = dict[tuple[str, str], _Square]()  # by boundary and Laplacian
        self._any_conformal = False

    def starts(self) -> Iterator[Start[RectangleMap]]:
        """Yield maps whose sides slide, on each Laplacian; then one by a map onto the disk.

        Flipped faces that were repaired are worth another Laplacian, not a map onto the disk.
        """
        for name in LAPLACIANS:
            yield partial(self._sliding, name)
        if not self._any_conformal:
            yield self._by_disk_map

    def is_good_start(self, made: RectangleMap) -> bool:
        """Whether no other start is tried."""
        return made.is_acceptable and made.repair.n_flipped == 0

    def needs_no_other_start(self, made: RectangleMap) -> bool:
        """Whether no Tutte embedding may lead nearer: a harmonic map is conformal as it is."""
        return self._any_conformal

    def _sliding(self, laplacian: str) -> RectangleMap:
        """Solve for both coordinates, with no flux across the sides along which they vary."""
        mesh, (bottom, right, top, left) = self.mesh, self.sides
        with self.phase("laplacian"):
            L = LAPLACIANS[laplacian](mesh)
        with self.phase("factor"):
            u, surface = _harmonic(mesh, L, zero=left, one=right)
            v, _ = _harmonic(mesh, L, zero=bottom, one=top)
        return self._scaled(_Square(u + 1j * v, L, laplacian, "sliding", surface))

    def _by_disk_map(self) -> RectangleMap:
        """Place the boundary as a map onto the disk tells, and both coordinates as harmonic."""
        mesh, phase = self.mesh, self.phase
        with phase("factor"):
            surface = FactoredSurface.of(mesh)
        with phase("circle"):
            z = solve(DiskProblem(surface, Options(), Phases(), known={}))._f
        with phase("extension"):
            f = np.empty(len(mesh.scaled), dtype=complex)
            corners = z[[side[0] for side in self.sides]]
            for number, side in enumerate(self.sides):
                start, along = (0, 1, 1 + 1j, 1j)[number], 1j**number
                f[side[:-1]] = start + along * along_side(z[side[:-1]], np.roll(corners, -number))
            f = harmonic_extension(surface, f[mesh.loop])
        return self._scaled(_Square(f, surface.laplacian, "cotangent", "disk map", surface))

    def _scaled(self, square: _Square) -> RectangleMap:
        """Scale a map onto the unit square to the modulus."""
        made = self._placed(square, square.stretched)
        self._any_conformal |= made.is_acceptable
        return made

    def tutte_starts(self, best: RectangleMap) -> Iterator[Start[RectangleMap]]:
        """Yield the map from a Tutte embedding with the sides of the last start."""
        square = replace(list(self._squares.values())[-1], laplacian="mean value")
        with self.phase("repair"):
            f, _ = tutte_embedding(self.mesh, square.stretched)
            f = from_tutte(self.mesh, f, target=Rectangle(self.sides))
        yield partial(self._placed, square, f)

    def _placed(self, square: _Square, f: Complex, known: float = 0.0) -> RectangleMap:
        """Repair, certify and judge a map (n,)."""
        mesh, sides, repair = self.mesh, self.sides, Repair()
        self._squares[square.boundary, square.laplacian] = square
        with self.phase("repair"):
            if along_sides(sides, f):
                f, repair = repaired(mesh, f)
        with self.phase("certificate"):
            degrees, certificate = map_distortion(mesh, f), certify_rectangle(mesh, sides, f)
            fields = judged(mesh, f, degrees, certificate, repair, known)
            if not (verdict := fields["conformality"]):
                fields["conformality"] = replace(verdict, remedies=(REMEDY,))
        return RectangleMap(
            **fields,
            _f=f,
            modulus=square.modulus,
            modulus_bounds=(1 / square.energies[0], square.energies[1]),
            width=float(f.real[sides[2][0]]),
            corners=tuple(int(side[0]) for side in sides),
            boundary=square.boundary,
            laplacian=square.laplacian,
            solver=square.surface.solver,
            timings=self.phase.seconds,
        )

    def on_target(self, made: RectangleMap) -> OnTarget:
        """Return a map as descent sees it."""
        order = self._squares[made.boundary, made.laplacian].surface.order
        laplacian = WeightedLaplacian(self.mesh, order[~self.mesh.on_boundary[order]])
        return OnTarget(Rectangle(self.sides), made._f, laplacian)

    def moved(self, made: RectangleMap, f: Complex, known: float) -> RectangleMap:
        """Return what descent made of a map."""
        return self._placed(self._squares[made.boundary, made.laplacian], f, known)


def _harmonic(mesh: Mesh, L: Laplacian, zero: Ints, one: Ints) -> tuple[Floats, FactoredSurface]:
    """(n,) harmonic function with these values on two sides, and what solved for it."""
    value, free = np.zeros(len(mesh.scaled)), np.ones(len(mesh.scaled), dtype=bool)
    value[one] = 1
    free[zero] = free[one] = False
    surface = FactoredSurface(mesh, L, free)
    return value + surface.solve(-(L.matrix() @ value)), surface


def along_side(z: Complex, corners: Complex) -> Floats:
    """Where the conformal map of the disk onto a rectangle takes an arc between two corners.

    The points z (k,) lie on the arc from the first corner to the second; the `corners` (4,) go
    counterclockwise around the unit circle. Returns (k,) numbers, 0 at the first and 1 at the
    second corner (L. V. Ahlfors. Complex Analysis. McGraw-Hill, 1979. Chapter 6, sect. 2.3).
    """
    a, b, c, d = corners
    # In the half-plane the corners lie at -1, 1, 1/k and -1/k; chords on the circle tell k, and
    # with it root = (1 - k) / (1 + k) (Ptolemy).
    across = abs(c - a) * abs(d - b)
    root = np.sqrt(abs(c - b) * abs(a - d) / across)
    k = abs(b - a) * abs(d - c) / across / (1 + root) ** 2
    with np.errstate(divide="ignore"):
        ratio = abs(z - a) / abs(z - b) * abs(c - b) / abs(c - a) / root  # (1 + x) / (1 - x)
    amplitude = 2 * np.arctan(np.sqrt(ratio)) - np.pi / 2  # arcsin x
    return (1 + ellipkinc(amplitude, k * k) / ellipk(k * k)) / 2
