"""What `surface_map` returns: charts of any surface, packed into a square."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import typed
from ..arrays import Complex, Floats, Ints, as_complex, coordinates, size_exponent, unit_size
from ..cached import cached_property
from ..errors import counted
from ..fields import Field, Method
from ..plot.layout import Layout
from ..records import Repair
from ..surface.location import FaceFinder
from ..surface.triangles import face_areas, oriented_areas
from ..verdict.certificate import Certificate
from ..verdict.distortion import AngleDistortion
from ..verdict.outline import OutlineCertificate
from ..verdict.texels import TexelDensity
from .bijection import Bijection
from .cut import Cut
from .disk_map import DiskMap
from .free_map import FreeMap
from .packing import Packing


@dataclass(frozen=True, eq=False, repr=False)
class SurfaceMap(Bijection):
    """A map of a surface onto charts, disks or with free outlines; printing it gives a summary.

    Attributes
    ----------
    uv : (m, 3, 2) float64
        Image of corner k of face f of the given F in its chart: in the unit disk or, with free
        outlines, in the unit of V.
        Corners of the same vertex have the same image, unless the surface was cut between them.
    charts : tuple of DiskMap, or of FreeMap
        The maps, those of the component with most faces first. Their rows are vertices of the
        opened chart, in a unit that is a power of two of that of V.
    face_chart : (m,) int64
        Which chart each face is in; -1 if it was left out, because it has no area or is there
        already. It lies where its twin does, or all at one place of a chart, or is NaN.
    cut : Cut
        The opened surface, with the edges that were cut and their length. Flipped faces still
        are flipped; of vertices that were merged, it names the first.
    added : (k, 2) int64
        Those of ``cut.edges`` that were not among the `seams` given.
    changes : tuple of str
        What was done to make disks, a sentence each; empty if the surface was a disk.
    certificate : Certificate or OutlineCertificate
        Those of all charts in one, valid if each of them is: the largest error, the winding number
        farthest from 1, all flipped faces (rows of ``charts[k].mesh.F``), and how many were decided
        exactly. It does not compare one chart with another.
    conformality : Conformality
        That of the worst chart: of those that are not conformal, if any, the one of the largest
        mean distortion. Of several charts, the reasons name it.
    distortion : AngleDistortion
        Of the given faces, all charts together.
    scale_variation : float
        Standard deviation over the area of the conformal factor, the logarithm of the scale;
        the largest of all charts. That of a disk is with its conformal barycentre at 0.
    scale_variation_asked : float
        What it was to be at most.
    texel_density : TexelDensity
        How evenly a texture covers the surface.
    packing : Packing
        How its charts lie in the square of the texture: `size`, `padding`, `density`, `rotate`.
    fill : float
        Share of this square that they cover.
    texels_per_unit : float
        Square root of the texels that they cover by the area of their faces.
    shares : (k,) float64
        Share of each chart in the area of the surface.
    timings : dict of str to float
        Seconds per phase of the maps that were kept, all charts together; "cut" is the rest: what
        was cleaned and cut, and the maps with cuts that grew on or that were parted.

    Examples
    --------
    Two caps, as a texture shows them:

    >>> import numpy as np
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    >>> result = cdcp_igl.surface_map(np.vstack([2 * V, V + 3]), np.vstack([F, F + len(V)]))
    >>> large, small = np.split(1024 * result.packed(size=1024, padding=8), 2)
    >>> round(float(large.min()), 6)
    8.0
    """

    uv: Floats
    charts: tuple[DiskMap | FreeMap, ...]
    face_chart: Ints
    cut: Cut
    added: Ints
    changes: tuple[str, ...]
    certificate: Certificate | OutlineCertificate
    scale_variation: float
    scale_variation_asked: float
    shares: Floats
    _angles: AngleDistortion
    _stopped: str  # why the scale varies more than was asked, if it does
    packing: Packing = field(default_factory=Packing)

    _kind = "surface"

    @property
    def V(self) -> Floats:
        """(n, 3) the vertices, as they were given; NaN where no face uses one."""
        V = np.full((self.cut.n_given, self.cut.V.shape[1]), np.nan)
        V[self.cut.vertex_index] = self.cut.V
        return V

    @property
    def distortion(self) -> AngleDistortion:
        """Mean, SD and maximum of the angular distortion of the given faces."""
        return self._angles

    @cached_property
    def uv_cut(self) -> Floats:
        """(n, 2) image of each vertex of ``cut``: ``uv_cut[cut.F]`` is ``uv``."""
        uv_cut = np.empty((len(self.cut.V), 2))
        uv_cut[self.cut.F] = self.uv
        return uv_cut

    @typed
    def packed(
        self,
        size: int | None = None,
        padding: float | None = None,
        density: float | None = None,
        rotate: bool | None = None,
    ) -> Floats:
        """Lay the charts into the unit square by their shape, with areas as on the surface.

        Parameters
        ----------
        size, padding, density, rotate
            As in `surface_map`; None for what that was told. Files, pages and `bake` have what that
            was told.

        Returns
        -------
        (m, 3, 2) float64
            Texture coordinates of each corner.

        Raises
        ------
        ValueError
            If the charts do not fit.
        """
        asked = {"size": size, "padding": padding, "density": density, "rotate": rotate}
        given: dict[str, Any] = {name: x for name, x in asked.items() if x is not None}
        places = self._placed(replace(self.packing, **given)) if given else self._places
        chart, (factor, move) = self._chart_of_vertex, places
        return coordinates(factor[chart] * self._in_charts + move[chart])[self.cut.F]

    @property
    def _in_charts(self) -> Complex:
        """(n,) images of the vertices of ``cut`` as the charts have them: V scaled to unit size."""
        free = isinstance(self.charts[0], FreeMap)
        return as_complex(np.ldexp(self.uv_cut, -size_exponent(self.cut.V) if free else 0))

    @cached_property
    def _chart_of_vertex(self) -> Ints:
        """(n,) the chart of each vertex of ``cut``, -1 of those in none."""
        mapped = np.flatnonzero(self.face_chart >= 0)
        chart = np.full(len(self.cut.V), -1)
        chart[self.cut.F[mapped]] = self.face_chart[mapped][:, None]
        others = self.cut.F[self.face_chart < 0]  # whose images are at one place
        chart[others] = np.where(
            chart[others] < 0, chart[others].max(axis=1)[:, None], chart[others]
        )
        return chart

    def _unfolded(self) -> tuple[Floats, Ints, Floats]:
        if not isinstance(self.charts[0], FreeMap):
            return super()._unfolded()
        chart = self._chart_of_vertex
        factor, move = replace(self.packing, density=None).places(self._outlines)  # as they are
        uv = coordinates((factor[chart] * self._in_charts + move[chart]) / abs(factor[0]))
        uv = np.ldexp(uv, size_exponent(self.cut.V))
        return self.cut.V, self._charted[1], uv

    @property
    def _outlines(self) -> list[Complex]:
        """Images of the boundary of each chart."""
        return [as_complex(chart.uv)[chart.mesh.loop] for chart in self.charts]

    @cached_property
    def _places(self) -> tuple[Complex, Complex]:
        """(k,) factor and displacement that take each chart to its place in the square."""
        return self._placed(self.packing)

    def _placed(self, packing: Packing) -> tuple[Complex, Complex]:
        F, exponent = self.cut.F[self.face_chart >= 0], size_exponent(self.cut.V)
        areas = self.shares * face_areas(unit_size(self.cut.V), F).sum()
        ratios = [chart.area_ratio for chart in self.charts if isinstance(chart, FreeMap)]
        if ratios:
            scale = 1 / np.sqrt(ratios)
        else:  # disks lie as `align` says
            scale, packing = np.sqrt(areas / np.pi), replace(packing, rotate=False)
        outlines = [k * z for k, z in zip(scale, self._outlines, strict=True)]
        factor, move = packing.places(outlines, unit=np.ldexp(1.0, -exponent))
        return factor * scale, move

    @cached_property
    def fill(self) -> float:
        """Share of the square that the charts cover."""
        _, F, uv = self._charted
        return float(oriented_areas(as_complex(uv), F)[0].sum() / 2)

    @property
    def texels_per_unit(self) -> float:
        """Square root of the texels that the charts cover by the area of their faces."""
        V, F = self._surface()
        area = face_areas(V, F[self.face_chart >= 0]).sum()
        return float(self.packing.size * np.sqrt(self.fill / area))

    @cached_property
    def texel_density(self) -> TexelDensity:
        """How evenly a texture covers the surface."""
        charted = np.flatnonzero(self.face_chart >= 0)
        V, F = self._surface()
        density = np.exp(self.area_distortion() / 2)  # of the faces in charts
        area = face_areas(unit_size(V), F[charted])  # V may have two columns
        return TexelDensity.of(density, area, self.face_chart[charted])

    @property
    def verdict(self) -> str:
        """Whether the map is valid, conformal, and of as even a scale as was asked for."""
        if not self.valid or self.scale_variation <= self.scale_variation_asked:
            return super().verdict
        return f"{super().verdict}, scale variation {self._variation}"

    @property
    def _plural(self) -> str:
        name = "chart" if isinstance(self.charts[0], FreeMap) else "disk"
        return counted(len(self.charts), name, f"{name}s")

    def _subject(self) -> str:
        return f"{counted(len(self.uv), 'face', 'faces')} onto {self._plural}"

    def _steps(self) -> list[tuple[str, str]]:
        return [
            ("texel density", str(self.texel_density)),
            ("scale variation", self._variation),
            ("length of the cut", f"{self.cut.length:.4g}"),
            ("packing", self._packed_as),
            *(("change", change) for change in self.changes),
        ]

    @property
    def _variation(self) -> str:
        said, asked = f"{self.scale_variation:.2f}", self.scale_variation_asked
        within = self.scale_variation <= asked
        return said if within else f"{said}, asked for: {asked:g} ({self._stopped})"

    @property
    def _packed_as(self) -> str:
        size = self.packing.size
        return f"{self.fill:.0%} of {size:,} x {size:,}, {self.texels_per_unit:.4g} texels a unit"

    def _made(self) -> dict[str, Any]:
        """Of the worst chart; repairs are those of all."""
        repairs = [chart.repair for chart in self.charts]
        flipped, moved, rounds = map(sum, zip(*map(astuple, repairs), strict=True))
        repair = Repair(flipped, moved, rounds)
        return self.charts[worst(self.charts)]._made() | {"repair": repair.report()}

    def _details(self) -> dict[str, Any]:
        return {
            "scale_variation": self.scale_variation,
            "scale_variation_asked": self.scale_variation_asked,
            "texel_density": asdict(self.texel_density)
            | {"charts": list(self.texel_density.charts)},
            "packing": asdict(self.packing)
            | {"fill": self.fill, "texels_per_unit": self.texels_per_unit},
            "cut_length": self.cut.length,
            "cut_edges": len(self.cut.edges),
            "added_edges": len(self.added),
            "changes": list(self.changes),
            "charts": [chart.report() for chart in self.charts],
        }

    def _surface(self) -> tuple[Floats, Ints]:
        """Return the given surface, but for vertices that no face uses."""
        used, row = np.unique(self.cut.vertex_index, return_inverse=True)
        return self.cut.V[: len(used)], row[self.cut.F]  # copies along the cut come last

    @property
    def _faces(self) -> Ints:
        return self.cut.vertex_index[self.cut.F]

    def _corner_images(self, face: Ints) -> Floats:
        return self.packed()[face]

    def _field(self, values: ArrayLike, method: Method | None = None) -> Field:
        # Of vertices that no face uses, the last ones may be there or not.
        n = int(self.cut.vertex_index.max()) + 1
        return Field.of(values, method).of_vertices(n, unused=True)

    @cached_property
    def _charted(self) -> tuple[Ints, Ints, Floats]:
        """(k,) the faces in charts, (k, 3) their corners as the charts have them, (n, 2) places.

        Other faces have no area, or are there twice; flipped faces of the surface are turned.
        """
        faces, uv = np.flatnonzero(self.face_chart >= 0), np.zeros((len(self.cut.V), 2))
        F = self.cut.F[faces]
        uv[F] = self.packed()[faces]
        area, _ = oriented_areas(as_complex(uv), F)
        return faces, np.where((area < 0)[:, None], F[:, ::-1], F), uv

    @cached_property
    def _finder(self) -> FaceFinder:
        _, F, uv = self._charted
        return FaceFinder(F, as_complex(uv))

    def _located(self, points: Floats) -> tuple[Ints, Floats]:
        faces, F, _ = self._charted
        found, barycentric, _ = self._finder.locate(as_complex(points))
        face = np.where(found < 0, -1, faces[found])
        turned = F[found, 0] != self.cut.F[face, 0]
        barycentric[turned] = barycentric[turned, ::-1]
        return face, barycentric

    def _layout(self) -> Layout:
        cut, (faces, F, uv) = self.cut, self._charted
        charts = np.full(len(cut.V), -1)
        charts[F] = self.face_chart[faces, None]
        return Layout(
            V=unit_size(cut.V),
            F=F,
            uv=2 * uv - 1,
            vertices=cut.vertex_index,
            faces=faces,
            plane=self._plural if len(self.charts) > 1 else self._plural.split()[1].capitalize(),
            middle=(0.5, 0.5),
            scale=0.5,
            distortion=self.distortion,
            flipped=len(self.certificate.flipped),
            facts=self._facts(f"{len(np.unique(cut.vertex_index)):,} vertices"),
            verdict=self.verdict,
            charts=charts if len(self.charts) > 1 else None,
        )


def worst(maps: Sequence[DiskMap | FreeMap]) -> int:
    """Find the chart of largest mean distortion, of those that are not conformal, if any."""
    return max(range(len(maps)), key=lambda k: (not maps[k].is_acceptable, maps[k].distortion.mean))
