"""A disk with four corners, mapped conformally onto a rectangle."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict, dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Complex, Floats, Ints, coordinates
from .certificate import Certificate, flipped_faces
from .distortion import AngleDistortion, angle_errors
from .errors import MapError, SolverError, counted, spell
from .plot.shown import Shown
from .solve.delaunay import intrinsic_delaunay_laplacian
from .solve.factor import Factor
from .solve.laplacian import Laplacian, cotangent_laplacian
from .steps.repair import Repair, unfold
from .surface.mesh import DiskMesh

__all__ = ["RectangleMap", "rectangle_map"]


@dataclass(frozen=True, eq=False)
class RectangleMap(Shown):
    """A conformal map onto a rectangle. Printing it gives a summary.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V, in the rectangle from (0, 0) to (modulus, 1).
    mesh : DiskMesh
        The surface.
    modulus : float
        Width by height, a conformal invariant of the surface with its corners.
    modulus_bounds : (float, float)
        Between which the modulus of the polyhedral surface lies, but for rounding: both
        coordinates are trial functions in Dirichlet's principle. `modulus` is their
        geometric mean.
    corners : tuple of int
        The vertices at (0, 0), (modulus, 0), (modulus, 1) and (0, 1).
    certificate : Certificate
        As of a `DiskMap`, with the sides of the rectangle in place of the circle.
    distortion : AngleDistortion
        Mean, SD and maximum of the angular distortion in degrees.
    laplacian : str
        ``"cotangent"``, or ``"intrinsic Delaunay"`` where that folded and this distorts less.
    repair : Repair
        What was done about flipped faces.

    Examples
    --------
    The modulus is known between bounds, and exactly for a square with its own corners:

    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.square(5)
    >>> ends = [-1, -1], [1, -1], [1, 1], [-1, 1]
    >>> corners = [abs(V[:, :2] - end).sum(axis=1).argmin() for end in ends]
    >>> cdcp_igl.rectangle_map(V, F, corners)
    RectangleMap(121 vertices: valid, modulus 1)
    """

    uv: Floats
    mesh: DiskMesh
    modulus: float
    modulus_bounds: tuple[float, float]
    corners: tuple[int, int, int, int]
    certificate: Certificate
    distortion: AngleDistortion
    laplacian: str
    repair: Repair

    @property
    def valid(self) -> bool:
        """True for a bijection onto the rectangle."""
        return self.certificate.valid

    def packed(self) -> Floats:
        """(n, 2) the image scaled into the unit square: texture coordinates."""
        return self.uv / max(self.modulus, 1)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the map to a file whose suffix says what.

        Parameters
        ----------
        path : path-like
            As in `DiskMap.save`.

        Raises
        ------
        ValueError, OSError
            As `DiskMap.save`.
        """
        from .io.saving import save

        save(self, path)

    def report(self) -> dict[str, Any]:
        """Everything but the coordinates, as JSON types."""
        return {
            "vertices": len(self.uv),
            "valid": self.valid,
            "modulus": self.modulus,
            "modulus_bounds": list(self.modulus_bounds),
            "corners": list(self.corners),
            "angular_distortion_degrees": asdict(self.distortion),
            "certificate": self.certificate.report(),
            "laplacian": self.laplacian,
            "repaired_faces": self.repair.n_flipped,
        }

    def __repr__(self) -> str:
        verdict = "valid" if self.valid else "NOT VALID"
        return f"RectangleMap({len(self.uv):,} vertices: {verdict}, modulus {self.modulus:.6g})"

    def __str__(self) -> str:
        low, high = self.modulus_bounds
        return "\n".join(
            [
                f"rectangle map of {len(self.uv):,} vertices: "
                + ("valid" if self.valid else "NOT VALID"),
                f"  modulus             {self.modulus:.8g}, from {low:.8g} to {high:.8g}",
                f"  angular distortion  {self.distortion}",
                f"  certificate         {self.certificate}",
                f"  Laplacian           {self.laplacian}",
                f"  repair              {self.repair}",
            ]
        )


def rectangle_map(V: ArrayLike, F: ArrayLike, corners: ArrayLike) -> RectangleMap:
    """Map a triangulated disk with four corners conformally onto a rectangle.

    Its width is found with the map, its height is 1. The coordinates are the harmonic
    functions with values 0 and 1 on two opposite sides, whose derivative across the other
    two vanishes; their energies give the modulus and bounds for it. Vertices slide along the
    sides. The image is a bijection onto the rectangle, certified as a map onto the disk is.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit.
    F : (m, 3) array_like of integers
        Corners of the faces, counterclockwise seen from outside.
    corners : (4,) array_like of integers
        Boundary vertices in counterclockwise order (the surface on the left), which go to
        (0, 0), (modulus, 0), (modulus, 1) and (0, 1).

    Returns
    -------
    RectangleMap

    Raises
    ------
    MeshError
        If the mesh is not a triangulated disk.
    ValueError
        If the corners are no four boundary vertices in this order, or an edge inside joins
        two vertices of one side: what it cuts off would become a segment of that side.
    MapError
        If no map is a bijection; the one of least distortion is its ``result``.
    SolverError
        If neither Laplacian can be factored.

    References
    ----------
    L. V. Ahlfors. Conformal Invariants. McGraw-Hill, 1973. Chapter 4: the modulus of a
    quadrilateral by Dirichlet's principle.

    Examples
    --------
    A rectangle is mapped to itself, scaled:

    >>> import cdcp_igl
    >>> V = [[0, 0], [6, 0], [6, 2], [0, 2], [3, 1]]
    >>> F = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    >>> result = cdcp_igl.rectangle_map(V, F, [0, 1, 2, 3])
    >>> result.valid, round(result.modulus, 12)
    (True, 3.0)
    """
    mesh = DiskMesh(V, F)
    sides = _sides(mesh, corners)
    _refuse_chords(mesh, sides)
    found: list[RectangleMap] = []
    with suppress(SolverError):  # the other Laplacian has no negative weights
        found.append(_mapped(mesh, cotangent_laplacian(mesh), "cotangent", sides))
    if not (found and found[0].valid and found[0].repair.n_flipped == 0):
        found.append(_mapped(mesh, intrinsic_delaunay_laplacian(mesh), "intrinsic Delaunay", sides))
    best = min(found, key=lambda result: (not result.valid, result.distortion.mean))
    if not best.valid:
        raise MapError(f"The map is not a bijection onto the rectangle: {best.certificate}", best)
    return best


def _sides(mesh: DiskMesh, corners: ArrayLike) -> list[Ints]:
    """Split the boundary loop: the vertices of each side with its corners, in order."""
    chosen = np.asarray(corners)
    if chosen.shape != (4,) or chosen.dtype.kind not in "iu":
        raise ValueError(f"corners must be four vertices, not {corners!r}")
    place, nB = mesh.place, len(mesh.loop)
    if not ((chosen >= 0) & (chosen < len(place))).all() or (place[chosen] < 0).any():
        raise ValueError(f"corners={chosen.tolist()} must be boundary vertices")
    steps = (np.roll(place[chosen], -1) - place[chosen]) % nB
    if (steps == 0).any() or steps.sum() != nB:
        order = mesh.loop[np.sort(place[chosen])].tolist()
        raise ValueError(
            f"corners={chosen.tolist()} must be four vertices in the order of the boundary, "
            f"the surface on the left, which is {order}"
        )
    return [
        mesh.loop[(place[corner] + np.arange(step + 1)) % nB]
        for corner, step in zip(chosen, steps, strict=True)
    ]


def _refuse_chords(mesh: DiskMesh, sides: list[Ints]) -> None:
    """Raise ValueError for edges inside that join two vertices of one side."""
    for number, side in enumerate(sides, 1):
        on_side = np.zeros(len(mesh.V), dtype=bool)
        on_side[side] = True
        chords = mesh.edges.ends(mesh.edges.chords(on_side))
        if len(chords):
            found = counted(len(chords), "edge inside joins", "edges inside join")
            raise ValueError(
                f"{found} two vertices of side {number}, so that the faces cut off would have no "
                f"area in a rectangle: {spell(chords)}. Choose a corner among these faces, or "
                "split the edges."
            )


def _mapped(mesh: DiskMesh, L: Laplacian, name: str, sides: list[Ints]) -> RectangleMap:
    """Solve for both coordinates, scale them by the modulus, and certify."""
    bottom, right, top, left = sides
    matrix = L.matrix()
    u = _harmonic(mesh, L, zero=left, one=right)
    v = _harmonic(mesh, L, zero=bottom, one=top)
    # The energy of the one with values 0 and 1 is height by width, that of the other width by
    # height, and each at most too large.
    bounds = float(1 / (u @ (matrix @ u))), float(v @ (matrix @ v))
    modulus = float(np.sqrt(bounds[0] * bounds[1]))
    f = modulus * u + 1j * v
    repair = Repair()
    if _monotone(sides, f):
        f, repair = unfold(mesh, f, on_disk=False)
    off = f.imag[bottom], f.real[right] - modulus, f.imag[top] - 1, f.real[left]
    flipped, n_exact = flipped_faces(f, mesh.F)
    certificate = Certificate(
        finite=bool(np.isfinite(f).all()),
        boundary_error=float(abs(np.concatenate(off)).max()),
        boundary_monotone=_monotone(sides, f),
        winding_number=1,  # of a boundary that runs through the four sides
        flipped=flipped,
        n_exact=n_exact,
    )
    first = tuple(int(side[0]) for side in sides)
    return RectangleMap(
        uv=coordinates(f),
        mesh=mesh,
        modulus=modulus,
        modulus_bounds=bounds,
        corners=(first[0], first[1], first[2], first[3]),
        certificate=certificate,
        distortion=AngleDistortion.of(np.degrees(abs(angle_errors(mesh, f)))),
        laplacian=name,
        repair=repair,
    )


def _harmonic(mesh: DiskMesh, L: Laplacian, zero: Ints, one: Ints) -> Floats:
    """(n,) harmonic function with these values on two sides, and no flux across the others."""
    value, free = np.zeros(len(mesh.V)), np.ones(len(mesh.V), dtype=bool)
    value[one] = 1
    free[zero] = free[one] = False
    return value + Factor(mesh, L, free).solve(-(L.matrix() @ value))


def _monotone(sides: list[Ints], f: Complex) -> bool:
    """Whether each side is run through forwards, no two vertices in one place."""
    bottom, right, top, left = sides
    return bool(
        (np.diff(f.real[bottom]) > 0).all()
        and (np.diff(f.imag[right]) > 0).all()
        and (np.diff(f.real[top]) < 0).all()
        and (np.diff(f.imag[left]) < 0).all()
    )
