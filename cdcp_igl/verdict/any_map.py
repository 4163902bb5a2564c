"""The certificate of anybody's map: of any surface, to the plane, corner by corner, or a sphere."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import (
    Complex,
    Floats,
    Indices,
    Ints,
    as_complex,
    distinct_rows,
    marked,
    places,
    size_exponent,
    unit_size,
)
from ..errors import counted, spell
from ..io.given import takes_meshes
from ..printing import Pairs, as_html, as_text, finite
from ..surface.topology import Topology, components_of_pairs, tails
from ..surface.triangles import (
    corner_cotangents,
    degenerate_faces,
    face_areas,
    flipped_faces,
    lost_in_single_precision,
    oriented_areas,
)
from ..surface.validation import checked_surface
from .certificate import flipped_on_sphere, solid_angles
from .distortion import (
    ON_SPHERE,
    AngleDistortion,
    AreaDistortion,
    reported_distortion,
)
from .outline import exterior_angles, goes_around, overlapping_edges

MANY = 100_000  # pairs of charts on one another: no more are sought


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MapCertificate:
    """What was verified about a map, whoever made it. Printing it gives a summary.

    A chart is a set of faces that hang together across edges with the same images on either side.
    Let every face be oriented as its chart is, no outlines cross, no wedges between edges overlap
    where outlines touch, and beside an edge of each outline lie its chart, once, and no other.
    Then no point of the plane is the image of two points, but for edges that touch: how many images
    a point has is constant between outlines, and largest beside one of them.

    Attributes
    ----------
    face_chart : (m,) ndarray of int64
        Which chart each face is in, -1 in none.
    mirrored : (k,) ndarray of int64
        Charts that are turned over as a whole, which is no defect.
    flipped : (k,) ndarray of int64
        Faces that are not oriented as their chart is, collapsed ones included; exactly.
    n_exact : int
        Faces whose sign was in doubt and decided in exact arithmetic.
    winding : (k,) ndarray of int64
        Turns of each outline, its exterior angles by 2 pi: 1 of an outer one, -1 of a hole. On the
        sphere: how many times each chart covers it.
    overlapping : (k, 2) ndarray of int64
        Faces at edges of outlines that cross, or that overlap where they touch; exactly. Some if
        there are any, and not always all.
    stacked : (k, 2) ndarray of int64
        Charts of which the first has an outline that lies on the second; a chart on itself, too.
        Of very many, not all.
    not_finite : (k,) ndarray of int64
        Faces with some coordinates that are not finite. All else is said of the others.
    angles : AngleDistortion
        Of libigl's angles, those of flipped faces counted as negative.
    areas : AreaDistortion
        Of the scale, with the density of texels.
    least_density : float
        Root of the least area of a face in the image by its area on the surface.
    lost, lost_share : int, float
        Faces that have no area in single precision, or are turned over; their share in the area.

    Examples
    --------
    Two squares, one upon the other:

    >>> import numpy as np
    >>> import cdcp_igl
    >>> square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    >>> V = np.vstack([np.column_stack([square, np.full(4, z)]) for z in (0, 1)])
    >>> F = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    >>> certificate = cdcp_igl.certify(V, F, V[:, :2])
    >>> certificate.valid, certificate.charts, len(certificate.overlapping) > 0
    (False, 2, True)
    """

    face_chart: Ints
    mirrored: Ints
    flipped: Ints
    n_exact: int
    winding: Ints
    overlapping: Ints
    stacked: Ints
    not_finite: Ints
    angles: AngleDistortion
    areas: AreaDistortion
    least_density: float
    lost: int
    lost_share: float

    @property
    def charts(self) -> int:
        """How many charts there are."""
        return int(self.face_chart.max()) + 1

    @property
    def valid(self) -> bool:
        """True if no point is the image of two points, but for edges that touch."""
        bad = self.not_finite, self.flipped, self.overlapping, self.stacked
        return self.charts > 0 and not any(len(rows) for rows in bad)

    def report(self) -> dict[str, Any]:
        """Return all but the chart of each face, as JSON types."""
        plain = {n: x.tolist() if isinstance(x, np.ndarray) else x for n, x in vars(self).items()}
        unmapped = int(np.count_nonzero(self.face_chart < 0)) - len(self.not_finite)
        made = {"valid": self.valid, "charts": self.charts, "unmapped_faces": unmapped, **plain}
        for name in ("angles", "areas"):
            made[name] = finite(asdict(made[name]))
        del made["face_chart"]
        return finite(made)

    def _pairs(self) -> Pairs:
        turns, counts = np.unique(self.winding, return_counts=True)
        winding = ", ".join(
            f"{turn} ({count:,})" for turn, count in zip(turns, counts, strict=True)
        )
        charts = counted(self.charts, "chart", "charts")
        said = [
            ("not finite", self.not_finite, counted(len(self.not_finite), "face", "faces")),
            ("overlaps", self.overlapping, f"at the faces {spell(self.overlapping)}"),
            ("on one another", self.stacked, f"charts {spell(self.stacked)}"),
            ("mirrored", self.mirrored, f"{len(self.mirrored):,} of {charts}"),
        ]
        return [
            ("flipped faces", f"{len(self.flipped):,} ({self.n_exact:,} decided exactly)"),
            *((name, text) for name, rows, text in said if len(rows)),
            ("winding", winding),
            ("angular distortion", str(self.angles)),
            ("area distortion", f"{self.areas}, least {self.least_density:.3g}"),
            ("in single precision", f"{self.lost:,} lost, {self.lost_share:.2g} of the surface"),
        ]

    @property
    def _title(self) -> str:
        faces = counted(len(self.face_chart), "face", "faces")
        verdict = "valid" if self.valid else "NOT VALID"
        return f"{faces} in {counted(self.charts, 'chart', 'charts')}: {verdict}"

    def __str__(self) -> str:
        return as_text(self._title, self._pairs())

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return as_html(self._title, self._pairs())


@takes_meshes
def certify(V: ArrayLike, F: ArrayLike, uv: ArrayLike) -> MapCertificate:
    """Verify a map, whoever made it: Blender, xatlas, libigl.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like
        Vertex positions of any surface, of several components, with a boundary or without.
    F : (m, 3) array_like of integers
        Corners of the faces. Faces that are oriented otherwise than a neighbour are in another
        chart.
    uv : (n, 2), (m, 3, 2) or (n, 3) array_like
        Images in the plane, of the vertices or of the corners of each face, NaN at all corners of
        a face that is on no chart; or, of a closed surface, images on the unit sphere. A face that
        has no area in V, and is all at one place in the image, is on no chart, either.

    Returns
    -------
    MapCertificate
        Also of a map that is not valid.

    Raises
    ------
    MeshError
        If V and F are no triangle mesh, or V is not finite.
    ValueError
        If `uv` has another shape, or is in space and not on the unit sphere, or of a surface with
        a boundary.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, uv = cdcp_igl.datasets.spherical_cap(10)
    >>> certificate = cdcp_igl.certify(V, F, uv)
    >>> certificate.valid, certificate.charts, certificate.winding
    (True, 1, array([1]))
    >>> uv[F[0, 0]] += 5
    >>> cdcp_igl.certify(V, F, uv).valid
    False
    """
    positions, faces = checked_surface(V, F)
    given, n, m = np.asarray(uv, dtype=np.float64), len(positions), len(faces)
    if given.shape not in ((n, 2), (m, 3, 2), (n, 3)):
        shapes = f"{(n, 2)}, {(m, 3, 2)} or {(n, 3)}"
        raise ValueError(f"uv has shape {given.shape}; it must be {shapes}")
    image = given if given.ndim == 3 else given[faces]
    is_finite, nowhere = np.isfinite(image).all(axis=(1, 2)), np.isnan(image).all(axis=(1, 2))
    at_one_place = np.flatnonzero((image == image[:, :1]).all(axis=(1, 2)))
    flat = degenerate_faces(corner_cotangents(unit_size(positions), faces[at_one_place]))
    rows = np.setdiff1d(np.flatnonzero(is_finite), at_one_place[flat])
    if len(rows) == 0:
        raise ValueError("uv maps no face: none has finite coordinates at all corners")
    image, on_sphere = image[rows], given.shape == (n, 3)
    charts = _Charts.of(faces[rows], image if given.ndim == 3 else None)
    surface, P = (charts.at_corners(x) for x in (positions[faces[rows]], image))
    exponent = 0 if on_sphere else size_exponent(P)
    P = unit_size(P, exponent)
    found, image_area, lost = (_on_sphere if on_sphere else _in_plane)(charts, P)
    flipped, area = found.pop("flipped"), face_areas(surface, charts.F)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.maximum(image_area, 0) / area
    unit = 2.0 ** (exponent - size_exponent(np.asarray(V)))
    of_face = np.full(m, -1)
    of_face[rows] = charts.of_face
    return MapCertificate(
        face_chart=of_face,
        flipped=rows[flipped],
        overlapping=rows[found.pop("overlapping", np.empty((0, 2), np.int64))],
        not_finite=np.flatnonzero(~is_finite & ~nowhere),
        angles=AngleDistortion.of(reported_distortion(surface, charts.F, P, flipped)),
        areas=AreaDistortion.of(ratio, area),
        least_density=float(np.sqrt(np.nanmin(ratio)) * unit),
        lost=len(lost),
        lost_share=float(area[lost].sum() / area.sum()),
        **found,
    )


@dataclass(frozen=True)
class _Charts:
    """Faces that hang together, and between them borders, even where they touch.

    Corners are one vertex if they lie around a vertex in one chart. Half-edge k m + f leaves
    corner k of face f.
    """

    F: Ints  # (m, 3)
    n: int
    of_face: Indices  # (m,)
    border: Ints  # half-edges

    @classmethod
    def of(cls, F: Ints, image: Floats | None) -> _Charts:
        """Part faces (m, 3) where images (m, 3, 2), if given, have a seam, and by orientation."""
        if image is not None:
            keys = np.column_stack([F.ravel(), image.reshape(-1, 2)])
            F = distinct_rows(keys)[1].reshape(-1, 3)
        m, n = len(F), int(F.max()) + 1
        surface, tail = Topology(F, n), tails(F, n)
        one, other = surface.twins
        opposite = tail[one] != tail[other]
        one, other = one[opposite], other[opposite]
        _, of_face = components_of_pairs(one % m, other % m, m)
        n, corner = surface.fans_across(one, other)
        border = np.flatnonzero(~marked(F.size, one, other))
        return cls(corner.reshape(3, m).T.astype(np.int64), n, of_face, border)

    @property
    def count(self) -> int:
        """How many there are."""
        return int(self.of_face.max()) + 1

    def at_corners(self, values: Floats) -> Floats:
        """(n, k) values (m, 3, k) of corners at the vertices here."""
        found = np.zeros((self.n, values.shape[2]))
        found[self.F.ravel()] = values.reshape(-1, values.shape[2])
        return found

    def upwards(self, areas: Floats) -> tuple[Ints, Ints]:
        """Find charts whose areas (m,) add up to less than 0; faces (m, 3) with these reversed."""
        mirrored = np.bincount(self.of_face, areas) < 0
        F = np.where(mirrored[self.of_face][:, None], self.F[:, ::-1], self.F)
        return np.flatnonzero(mirrored), F


Found = tuple[dict[str, Any], Floats, Ints]  # what was verified, areas, faces lost


def _in_plane(charts: _Charts, P: Floats) -> Found:
    """Verify images (n, 3) in the plane z = 0."""
    z, m = as_complex(P[:, :2]), len(charts.F)
    mirrored, F = charts.upwards(oriented_areas(z, charts.F)[0])
    flipped, n_exact = flipped_faces(z, F)
    # What lies on the left of each edge of an outline is the chart.
    tail, head = charts.F.T.ravel()[[charts.border, (charts.border + m) % (3 * m)]]
    face = charts.border % m
    backwards = np.isin(charts.of_face[face], mirrored)
    tail, head = np.where(backwards, head, tail), np.where(backwards, tail, head)
    after, outline = places(tail, charts.n)[head], z[tail]
    _, loop = components_of_pairs(np.arange(len(after)), after, len(after))
    turns = exterior_angles(outline, after)
    found = {
        "mirrored": mirrored,
        "flipped": flipped,
        "n_exact": n_exact,
        "winding": np.rint(np.bincount(loop, turns) / (2 * np.pi)).astype(np.int64),
        "overlapping": face[overlapping_edges(outline, after)],
        "stacked": _stacked(outline, after, loop, charts.of_face[face], charts.count),
    }
    area = oriented_areas(z, F)[0] / 2
    return found, area, lost_in_single_precision(P[:, :2], charts.F)


def _stacked(z: Complex, after: Ints, loop: Indices, chart: Indices, n: int) -> Ints:
    """(k, 2) charts, an outline of the first of which lies on the second.

    z, `after`, the `loop` and one of n charts of each edge are those of all outlines.
    """
    rise = abs(z.imag[after] - z.imag)
    by_rise, steepest = np.argsort(rise), np.zeros(loop.max(initial=-1) + 1, np.int64)
    steepest[loop[by_rise]] = by_rise  # the last one stays
    asked = steepest[rise[steepest] > 0]
    found = [np.empty((0, 2), np.int64)]
    for query, edge, sign in goes_around(z, after, asked):
        both, which = np.unique(query * n + chart[edge], return_inverse=True)
        times = np.bincount(which.ravel(), sign, len(both))
        first, second = chart[asked[both // n]], both % n
        found.append(np.column_stack([first, second])[times != (first == second)])
        if sum(map(len, found)) > MANY:
            break
    return np.unique(np.concatenate(found), axis=0)


def _on_sphere(charts: _Charts, P: Floats) -> Found:
    """Verify images (n, 3) of a closed surface on the unit sphere."""
    if (abs(np.linalg.norm(P, axis=1) - 1) > ON_SPHERE).any():
        raise ValueError("uv (n, 3) must lie on the unit sphere, as the points of a SphereMap do")
    if len(charts.border):
        raise ValueError("uv (n, 3) is for closed surfaces, and this one has a boundary")
    mirrored, F = charts.upwards(solid_angles(P, charts.F))
    flipped, n_exact = flipped_on_sphere(P, F)
    degree = np.rint(np.bincount(charts.of_face, solid_angles(P, F)) / (4 * np.pi)).astype(np.int64)
    twice, each = np.flatnonzero(degree > 1), np.arange(charts.count)
    found = {
        "mirrored": mirrored,
        "flipped": flipped,
        "n_exact": n_exact,
        "winding": degree,
        "stacked": np.column_stack(
            [np.append(twice, each[:-1]), np.append(twice, each[1:])]  # all cover the sphere
        ),
    }
    area = face_areas(P, F)
    area[flipped] = 0
    return found, area, flipped_on_sphere(P.astype(np.float32).astype(np.float64), F)[0]
