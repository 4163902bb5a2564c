"""A disk with four corners, mapped conformally onto a rectangle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ellipk, ellipkinc

from ..arrays import Complex, Floats, Ints, as_complex, coordinates, marked
from ..descent.descent import from_tutte
from ..descent.targets import Rectangle
from ..docstrings import like
from ..errors import counted, spell
from ..io.given import takes_meshes
from ..options import Options
from ..phases import Phases, Progress
from ..rescue.means import embedding
from ..rescue.repair import Repair, repaired
from ..result.base import announced, valid_map
from ..result.making import PlaneMap, best_of, fields_of, refined, steps_of
from ..solve.factored import FactoredSurface, harmonic_extension
from ..solve.laplacian import LAPLACIANS, Laplacian
from ..solve.solvers import SolverName, using
from ..surface.filling import split_edges
from ..surface.mesh import DiskMesh, Mesh
from ..verdict.certificate import Certificate, along_sides, certify_rectangle
from ..verdict.distortion import map_distortion
from .disk import disk_map, map_of

# Phases of a map onto the disk, which a map onto a rectangle has only where its sides cannot slide.
OF_THE_DISK = ("center", "trace", "circle", "extension", "mobius")
REMEDY = "choose corners where the boundary has corners, or refine the faces there"


@dataclass(frozen=True, eq=False, repr=False)
class RectangleMap(PlaneMap):
    """A conformal map onto a rectangle. Printing it gives a summary.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V, in the rectangle from (0, 0) to (width, 1).
    mesh : DiskMesh
        The surface.
    modulus : float
        Width by height of the exact map, a conformal invariant of the surface with its corners.
    modulus_bounds : (float, float)
        Between which the modulus of the polyhedral surface lies, but for rounding: both
        coordinates are trial functions in Dirichlet's principle. `modulus` is their
        geometric mean.
    width : float
        Of the rectangle: the modulus, or as lower shear and refinement have left it.
    corners : tuple of int
        The vertices at (0, 0), (width, 0), (width, 1) and (0, 1).
    split : (k, 2) int64
        The edges that were split at their middles. `mesh` and `uv` have these after the rows of V,
        and the further halves of faces after those of F; ``to_given`` leaves them out.
    certificate : Certificate
        As of a `DiskMap`, with the sides of the rectangle in place of the circle.
    conformality, distortion, timings
        As of every `Result`; the seconds include those of maps that were not taken, "circle" is
        the map onto the disk.
    boundary : str
        ``"sliding"``: there is no flux across the sides along which a coordinate varies. Or,
        where that does not lead to a conformal map and this distorts less, ``"disk map"``: the
        sides are placed as `disk_map` and elliptic integrals tell, for obtuse faces at a side may
        make vertices on it change places.
    laplacian : str
        ``"cotangent"``; or, where that flipped faces, or its map is not conformal, and this
        distorts less, ``"intrinsic Delaunay"``; or, where no map is conformal, ``"mean value"``:
        shear was lowered from an embedding.
    repair, refinement, solver
        As of a `DiskMap`.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.square(5)
    >>> ends = [-1, -1], [1, -1], [1, 1], [-1, 1]
    >>> corners = [abs(V[:, :2] - end).sum(axis=1).argmin() for end in ends]
    >>> cdcp_igl.rectangle_map(V, F, corners)
    RectangleMap(121 vertices: valid, modulus 1)
    """

    certificate: Certificate
    modulus: float
    modulus_bounds: tuple[float, float]
    width: float
    corners: tuple[int, ...]
    split: Ints = field(default_factory=lambda: np.empty((0, 2), np.int64))

    _kind = "rectangle"
    _plane = "Rectangle"
    _reported = ("modulus", "modulus_bounds", "width", "corners")

    @property
    def is_embedded(self) -> bool:
        """Whether the map comes from an embedding by mean values."""
        return self.laplacian == "mean value"

    @property
    def change(self) -> str:
        """What was done to the surface, or nothing."""
        edges = counted(len(self.split), "edge", "edges")
        return f"split {edges} between two vertices of a side" if len(self.split) else ""

    def _key_figure(self) -> str:
        return f"modulus {self.modulus:.6g}"

    def _steps(self) -> list[tuple[str, str]]:
        low, high = self.modulus_bounds
        return [
            ("modulus", f"{self.modulus:.8g}, from {low:.8g} to {high:.8g}"),
            ("width", f"{self.width:.6g}"),
            ("boundary", f"{self.boundary}, {self.laplacian} Laplacian"),
            *([("change", self.change)] if self.change else []),
            *super()._steps(),
        ]


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
            n, chords = len(mesh.V), _chords(mesh, sides, split)
            if len(chords):
                mesh = DiskMesh(*split_edges(mesh.positions, mesh.F, chords))
        best = replace(_best_map(mesh, sides, options, phase), split=chords)
        if len(chords):
            vars(best)["given_rows"] = np.append(np.arange(n), [-1] * len(chords)), n
    remedy = "Parts of it may be too small for double precision: choose corners farther apart"
    best = valid_map(best, " onto the rectangle", remedy)
    phase.done()
    return announced(best)


@dataclass(frozen=True, eq=False)
class _Square:
    """A map onto the unit square with harmonic coordinates, and what it was made by."""

    f: Complex
    L: Laplacian
    laplacian: str
    boundary: str
    surface: FactoredSurface


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
    found = [mesh.edges.ends(mesh.edges.chords(marked(len(mesh.V), side))) for side in sides]
    for number, chords in enumerate(found, 1):
        if len(chords) and not split:
            count = counted(len(chords), "edge inside joins", "edges inside join")
            raise ValueError(
                f"{count} two vertices of side {number}, so that the faces cut off would have no "
                f"area in a rectangle: {spell(chords)}. Choose a corner among these faces, or have "
                "the edges split (split=True, --split)."
            )
    return np.concatenate(found)


def _best_map(mesh: Mesh, sides: list[Ints], options: Options, phase: Phases) -> RectangleMap:
    """Try one way after the other until a map is conformal; the best, refined, valid or not."""
    squares: dict[RectangleMap, _Square] = {}

    def made(way: Callable[[], _Square], f: Complex | None = None) -> RectangleMap:
        square = way()
        result = _finished(mesh, sides, square, phase, f)
        squares[result] = square
        return result

    def enough(made: RectangleMap) -> bool:
        # Flipped faces that were repaired are worth another Laplacian, not a map onto the disk.
        conformal = [one for one in squares if one.conformal]
        return bool(conformal) and (len(squares) > 1 or made.repair.n_flipped == 0)

    def lowered(plain: RectangleMap) -> RectangleMap:
        if not (steps := steps_of(plain, options)):
            return plain
        square, f = squares[plain], as_complex(plain.uv)
        order = square.surface.order
        order = order[~mesh.on_boundary[order]]
        finished = partial(_finished, mesh, sides, square, phase)
        return refined(plain, f, Rectangle(sides), order, steps, finished, options, phase)

    def embedded() -> RectangleMap:
        plain, square = list(squares.items())[-1]
        with phase("repair"):
            f, _ = embedding(mesh, as_complex(plain.uv))
            f = from_tutte(mesh, f, target=Rectangle(sides))
        return lowered(made(partial(replace, square, laplacian="mean value"), f))

    ways = [partial(_sliding, name, mesh, sides, phase) for name in LAPLACIANS]
    ways.append(partial(_by_disk_map, mesh, sides, phase))
    best = lowered(best_of((partial(made, way) for way in ways), enough))
    return best_of((lambda: best, embedded), lambda _: any(one.conformal for one in squares))


def _sliding(name: str, mesh: Mesh, sides: list[Ints], phase: Phases) -> _Square:
    """Solve for both coordinates, with no flux across the sides along which they vary."""
    bottom, right, top, left = sides
    with phase("laplacian"):
        L = LAPLACIANS[name](mesh)
    with phase("factor"):
        u, surface = _harmonic(mesh, L, zero=left, one=right)
        v, _ = _harmonic(mesh, L, zero=bottom, one=top)
    return _Square(u + 1j * v, L, name, "sliding", surface)


def _harmonic(mesh: Mesh, L: Laplacian, zero: Ints, one: Ints) -> tuple[Floats, FactoredSurface]:
    """(n,) harmonic function with these values on two sides, and what solved for it."""
    value, free = np.zeros(len(mesh.V)), np.ones(len(mesh.V), dtype=bool)
    value[one] = 1
    free[zero] = free[one] = False
    surface = FactoredSurface(mesh, L, free)
    return value + surface.solve(-(L.matrix() @ value)), surface


def _by_disk_map(mesh: Mesh, sides: list[Ints], phase: Phases) -> _Square:
    """Place the boundary as a map onto the disk tells, and both coordinates as harmonic."""
    with phase("factor"):
        surface = FactoredSurface.of(mesh)
    with phase("circle"):
        disk = map_of(surface, Options(), Phases(), known={})
    with phase("extension"):
        z, f = as_complex(disk.uv), np.empty(len(mesh.V), dtype=complex)
        corners = z[[side[0] for side in sides]]
        for number, side in enumerate(sides):
            start, along = (0, 1, 1 + 1j, 1j)[number], 1j**number
            f[side[:-1]] = start + along * along_side(z[side[:-1]], np.roll(corners, -number))
        f = harmonic_extension(surface, f[mesh.loop])
    return _Square(f, surface.laplacian, "cotangent", "disk map", surface)


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


def _finished(
    mesh: Mesh,
    sides: list[Ints],
    square: _Square,
    phase: Phases,
    f: Complex | None = None,
    known: float = 0.0,
) -> RectangleMap:
    """Scale a map onto the unit square to the modulus, or take one f (n,) that is there.

    It is repaired, certified and judged.
    """
    u, v, matrix = square.f.real, square.f.imag, square.L.matrix()
    # The energy of the one with values 0 and 1 is height by width, that of the other width by
    # height, and each at most too large.
    energy_u, energy_v = float(u @ (matrix @ u)), float(v @ (matrix @ v))
    modulus = float(np.sqrt(energy_v / energy_u))
    if f is None:
        f = modulus * u + 1j * v
    repair = Repair()
    with phase("repair"):
        if along_sides(sides, f):
            f, repair = repaired(mesh, f)
    with phase("certificate"):
        certificate = certify_rectangle(mesh, sides, f)
        degrees = map_distortion(mesh, f)
        fields = fields_of(mesh, f, degrees, certificate, repair, known=known)
        if not (verdict := fields["conformality"]):
            fields["conformality"] = replace(verdict, remedies=(REMEDY,))
    return RectangleMap(
        **fields,
        uv=coordinates(f),
        modulus=modulus,
        modulus_bounds=(1 / energy_u, energy_v),
        width=float(f.real[sides[2][0]]),
        corners=tuple(int(side[0]) for side in sides),
        boundary=square.boundary,
        laplacian=square.laplacian,
        solver=square.surface.solver,
        timings=phase.seconds,
    )
