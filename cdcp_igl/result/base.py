"""The base of all results: what a map says of itself, how it is drawn, saved and printed."""

from __future__ import annotations

import json
import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arguments import typed
from ..arrays import Floats, Ints, in_space, unit_size
from ..errors import MapError, counted, spell
from ..fields import Field, Labelled, Method
from ..io.given import FromFile
from ..io.images import Texture
from ..plot.layout import Layout
from ..plot.raster import sample
from ..printing import Pairs, as_html, as_text
from ..records import BoundaryMethod
from ..surface.orientation import INWARD, wrong_side
from ..surface.topology import Topology
from ..surface.triangles import face_areas, lost_in_single_precision
from ..verdict.certificate import Certificate, SphereCertificate
from ..verdict.conformality import Conformality
from ..verdict.distortion import AngleDistortion, area_distortion
from ..verdict.outline import OutlineCertificate

if TYPE_CHECKING:
    from .pattern import Pattern

log = logging.getLogger("cdcp_igl")

MOST_PIXELS = 2**16  # along a side: no program opens a larger image
PICTURES = (".pdf", ".png", ".svg")

# Beyond it a page is more than about half a megabyte, and a notebook keeps each that it shows.
MOST_VERTICES_OF_PAGES = 20_000


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Result(FromFile, ABC):
    """A map with its certificate, such as a DiskMap or a SphereMap.

    Printing it gives a summary.

    Attributes
    ----------
    uv : ndarray of float64
        (n, 2) images of the vertices; of a SurfaceMap or SphereMap (m, 3, 2), those of the corners.
    V, F : ndarray of float64, of int64
        The surface, in the rows and in the unit in which it was given.
    certificate : Certificate, OutlineCertificate or SphereCertificate
        What was verified about `uv`.
    conformality : Conformality
        Whether the map is what a conformal map of this mesh should be; if not, the reasons
        and what would help.
    distortion : AngleDistortion
        Mean, SD and maximum of the angular distortion (7) in degrees, of libigl's angles.
    timings : dict of str to float
        Seconds per phase.
    """

    certificate: Certificate | OutlineCertificate | SphereCertificate
    conformality: Conformality
    timings: dict[str, float]

    _kind: ClassVar[str]  # of map, as it is called when it is printed
    _plane: ClassVar[str]  # what the image is called

    @property
    def V(self) -> Floats:
        """(n, 3) the vertices, in the rows and in the unit in which they were given."""
        return self._surface()[0]

    @property
    def F(self) -> Ints:
        """(m, 3) the faces, rows of `V`, as they were given."""
        return self._faces

    @property
    @abstractmethod
    def distortion(self) -> AngleDistortion:
        """Of the angles, see above: libigl's, reckoned when they are first read."""

    @property
    def valid(self) -> bool:
        """True for a certified bijection, see `certificate`."""
        return self.certificate.valid

    @property
    def conformal(self) -> bool | None:
        """True for a map that is as conformal as the mesh lets it be, see `conformality`.

        None if that was not asked for, as the map keeps lengths or areas.
        """
        return self.conformality.verdict

    @property
    def is_acceptable(self) -> bool:
        """Whether nothing is objected to: it is conformal, or that was not asked for."""
        return not self.conformality.reasons

    @property
    def verdict(self) -> str:
        """In a word or two, whether the map is valid and conformal."""
        if not self.valid:
            return "NOT VALID"
        return "valid" if self.is_acceptable else "valid, NOT CONFORMAL"

    @property
    def side(self) -> str:
        """What is wrong with the side that faces point to, as of `check`, and what that does."""
        V, F = self._surface()
        said, _ = wrong_side(unit_size(V), Topology(F, len(V)))
        if not said:
            return ""
        seen = "outside" if said == INWARD else "above"
        return f"{said}: the map is as seen from {seen}{'' if self._turned else ', mirrored'}"

    @property
    def _turned(self) -> bool:
        """Whether faces that point to the wrong side are clockwise in the image, too."""
        return False

    @abstractmethod
    def packed(self) -> Floats:
        """Return the map scaled into the unit square: texture coordinates, shaped as `uv`."""

    @typed
    def bake(
        self,
        values: ArrayLike | str | PathLike[str] | Callable[[Floats], ArrayLike],
        size: int = 1024,
        *,
        method: Method | None = None,
        uv: ArrayLike | None = None,
    ) -> Floats:
        """Bake values at the vertices, a function, or another image to one of the unit square.

        Parameters
        ----------
        values : (n, ...) array_like, callable, path-like or (height, width, c) array_like
            Values at the vertices, such as colours, as in `interpolate`; a function of points
            (k, 3) of the surface, in the unit of V, that returns k rows; or an image that the
            surface showed before: a file of an image, an array with `uv`, or the obj, ply, glb or
            gltf file of the surface itself, with the images of its materials (base colours; white
            where a face has none). Images are read by Pillow, and repeat beside the square.
        size : int
            Pixels along each side of the square, where the map lies as in `packed`.
        method
            As in `interpolate`.
        uv : (m, 3, 2) or (n, 2) array_like, optional
            Where such an image lies, from its lower left corner: texture coordinates of the
            corners or the vertices, as `cdcp_igl.io.read_texture` reads them. By default those of
            the file that was given in place of V and F.

        Returns
        -------
        (size, size, ...) float64
            The top row lies at v = 1. Pixels beside the image of the surface have the values of
            the nearest pixel on it, so that filtered textures show no rim.

        Raises
        ------
        ValueError
            If `values` has not a row for each vertex, or point, is complex, or no image; if `uv`
            does not fit the faces or is needed; or if `size` is not positive or so small that no
            pixel lies on the surface.
        MeshError
            If a file of a surface shows no image.
        ImportError
            If Pillow is needed, and not installed.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.square(5)
        >>> cdcp_igl.free_map(V, F).bake(V, size=64).shape
        (64, 64, 3)
        """
        from scipy.ndimage import distance_transform_edt  # slow to import, and used here alone

        from .baking import painter

        layout = self._layout()
        paint = painter(self, layout, values, method, uv)
        if not 1 <= size <= MOST_PIXELS:
            raise ValueError(f"size must be at least 1 and at most {MOST_PIXELS:,}, not {size!r}")
        left, bottom = -2 * layout.origin[0], -2 * layout.origin[1]  # of the unit square
        raster = sample(layout.uv, layout.F, size, (left, left + 2, bottom, bottom + 2))
        if not (seen := raster.seen).any():
            raise ValueError(f"no pixel lies on the surface: size must be larger than {size}")
        painted = paint(raster.face[seen], raster.weights[seen])
        image = np.zeros((size, size, *painted.shape[1:]))
        image[seen] = painted
        row, column = distance_transform_edt(~seen, return_distances=False, return_indices=True)
        return image[row, column]

    def area_distortion(self) -> Floats:
        """Logarithm of the area in the plane by that on the surface, as fractions of their totals.

        Returns
        -------
        (k,) float64
            Of each face, or of those in a chart; see `cdcp_igl.area_distortion`. The charts of a
            SurfaceMap lie as in `packed`.
        """
        layout = self._layout()
        return area_distortion(layout.V, layout.F, layout.uv)

    def lost_in_single_precision(self) -> tuple[int, float]:
        """Count the faces that have no area as texture coordinates in single precision.

        Renderers, and glb files, have no other; an obj file keeps all digits.

        Returns
        -------
        faces : int
            Whose corners, in the unit square as in `packed`, coincide or lie on a line as float32.
        share : float
            Their share in the area of the surface.
        """
        layout = self._layout()
        lost = lost_in_single_precision(layout.uv / 2 + layout.origin, layout.F)
        areas = face_areas(layout.V, layout.F)
        return len(lost), float(areas[lost].sum() / areas.sum())

    @typed
    def report(self, *, flat: bool = False) -> dict[str, Any]:
        """Return everything but the coordinates.

        Parameters
        ----------
        flat : bool
            One row for a table: numbers, truth values and short strings, named by their path
            in the report, such as ``"certificate_winding_number"``.

        Returns
        -------
        dict
            JSON types.

        Examples
        --------
        For a table, ``pandas.DataFrame([result.report(flat=True) for result in results])``.

        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> result = cdcp_igl.disk_map(V, F)
        >>> result.report(flat=True)["center_method"]
        'torsion'
        """
        vertices, faces = self._size()
        lost, share = self.lost_in_single_precision()
        report = {
            "vertices": vertices,
            "faces": faces,
            "vertices_left_out": self.left_out,
            "valid": self.valid,
            "side": self.side,
            **self.conformality.report(),
            "angular_distortion_degrees": asdict(self.distortion),
            "certificate": self.certificate.report(),
            "lost_in_single_precision": {"faces": lost, "share_of_area": share},
            **self._details(),
            **self._made(),
            "seconds": self.timings,
        }
        return _flattened(report) if flat else report

    @typed
    def save(self, path: str | PathLike[str], *, image: Texture | None = None) -> None:
        """Write the map to a file whose suffix says what.

        Parameters
        ----------
        path : path-like
            The surface with its map for the types of `cdcp_igl.io.write_map`; a picture for
            .png, .svg and .pdf; the page of `view` for .html; the report for .json. An
            existing file is replaced once the new one is complete. Where a file was given in
            place of V and F, what it has is kept as with `like` there; what is not is logged.
        image : path-like or (height, width, 3 or 4) array_like, optional
            What a glb or obj file shows, over the unit square that `packed` fills: as `view` has
            it as a texture, a PNG or JPEG file or colours, such as `bake` makes.

        Raises
        ------
        ValueError
            If the file is not of a known type, or the file that was given has changed; if the
            image is none, or the file shows none.
        OSError
            If it cannot be written; nothing is left behind.
        """
        from ..io import WRITABLE, read_mesh, write_map
        from ..io.neuro import neuro_type
        from ..io.output import whole_file, write_text
        from ..io.writing import carries, warn_of_loss

        suffix, neuro = Path(path).suffix.lower(), neuro_type(Path(path))
        if image is not None and suffix not in (".glb", ".obj"):
            raise ValueError(f"A {suffix} file shows no image: save .glb or .obj.")
        known = (*WRITABLE, *PICTURES, ".html", ".json")
        if suffix not in known and neuro:
            write_map(path, *self._surface(), self, like=self.source)
        elif suffix in WRITABLE:
            (V, F), like = self._surface(), self.source
            if like and self.given_rows:  # and not the file's
                warn_of_loss(like, Path(path), rows=False)
                like = None
            if like and not carries(like, suffix):
                like = None
            if like:
                corners, (V, F) = in_space(V)[F], read_mesh(like)
                if F.shape != corners.shape[:2] or not np.array_equal(in_space(V)[F], corners):
                    raise ValueError(f"{like.name!r} has changed since the surface was read.")
            write_map(path, V, F, self, like=like, image=image)
        elif suffix in PICTURES:
            figure = self.plot()[0].figure
            with whole_file(path) as unfinished:
                figure.savefig(unfinished)
        elif suffix == ".html":
            self.view(path)
        elif suffix == ".json":
            write_text(path, json.dumps(self.report(), indent=2, ensure_ascii=False) + "\n")
        else:
            writable = f"{' '.join(known)} .gii .gii.gz, lh.NAME and rh.NAME"
            raise ValueError(f"{Path(path).name!r} is of no known type. Writable: {writable}")

    @typed
    def pattern(
        self, path: str | PathLike[str] | None = None, *, unit: str = "mm", folds: bool = False
    ) -> Pattern:
        """Draw a pattern to cut, true to scale: the outlines of the map, and which edges meet.

        Of a map with free outlines. Darts and slits are parts of the outlines; both sides of a
        seam have a notch of the same number, at places that meet.

        Parameters
        ----------
        path : path-like, optional
            Named .svg, or .dxf, for which ezdxf must be installed; replaced once the new file is
            complete.
        unit : {"mm", "cm", "m", "in", "ft"}
            That of the surface. Coordinates in the file are in this unit; a dxf file names it,
            and an svg file has its size in millimetres.
        folds : bool
            Draw the edges within, too, as for papercraft.

        Returns
        -------
        Pattern
            The lines, and their lengths beside those on the surface.

        Raises
        ------
        ValueError
            If the outline is not free, the file is of no such type, or the unit is none of these.
        ImportError
            If ezdxf is needed, and not installed.
        OSError
            If the file cannot be written; nothing is left behind.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.square(5)
        >>> pattern = cdcp_igl.free_map(V, F).pattern()
        >>> round(pattern.length, 9), round(pattern.area, 9), pattern.seams
        (8.0, 4.0, 0)
        """
        from ..io.output import whole_file
        from ..io.patterns import PATTERNS, UNITS, write_dxf, write_svg
        from .pattern import pattern_of

        suffix = PATTERNS[0] if path is None else Path(path).suffix.lower()
        if suffix not in PATTERNS:
            raise ValueError(f"A pattern is written as {' or '.join(PATTERNS)}, not {suffix!r}")
        if unit not in UNITS:
            raise ValueError(f"unit must be one of {', '.join(UNITS)}, not {unit!r}")
        made = pattern_of(*self._unfolded(), folds=folds)
        if path is not None:
            with whole_file(path) as unfinished:
                (write_svg if suffix == ".svg" else write_dxf)(unfinished, made.lines, unit)
        return made

    def _unfolded(self) -> tuple[Floats, Ints, Floats]:
        """V, F and the images (n, 2) of V, beside one another, in the unit of V."""
        raise ValueError(
            "a pattern needs a free outline: take free_map, or surface_map without outline='disk'"
        )

    @typed
    def plot(self, *, name: str = "") -> NDArray[Any]:
        """Draw the surface, its image, a checkerboard and the distortion side by side.

        The surface is coloured by its normals, its image has the same colours; the squares of
        the checkerboard keep their right angles where the map is conformal; the histogram of
        the angular distortion shows its mean and, as a band, one standard deviation (SD) to
        either side. A disk is turned to match the view of the surface.

        Parameters
        ----------
        name : str
            Of the surface, for the title.

        Returns
        -------
        (4,) ndarray of matplotlib.axes.Axes
            In a figure that does not depend on pyplot: ``axes[0].figure.savefig``.

        Raises
        ------
        ImportError
            If Matplotlib is not installed.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> axes = cdcp_igl.disk_map(V, F).plot(name="cap")
        >>> axes[1].get_title()
        'disk in the same colours'
        """
        from ..plot.pictures import draw  # needs Matplotlib, which is optional and slow to import

        return np.array(draw(self._layout(), name).axes)

    @typed
    def view(
        self,
        path: str | PathLike[str] | None = None,
        *,
        fields: Mapping[str, Labelled] | None = None,
        texture: Texture | None = None,
        beside: Mapping[str, ArrayLike] | None = None,
        keep: Sequence[float | str] = (),
        title: str = "",
    ) -> Path:
        """Write a page that shows the map, or open it in the browser.

        A single file that needs no network and no library: the surface turns beside its image;
        the face under the pointer is marked on both, and stays marked after a click. It opens on
        what is given here, a texture or a field, and on a checkerboard otherwise; charts, normals,
        the angular distortion and the conformal factor, each with its histogram, are a button away.
        Colours of values have a range, a threshold below which they are grey, and a choice of
        sequential, diverging and cyclic scales.

        Parameters
        ----------
        path : path-like, optional
            Named .html; replaced once the new one is complete. Without it, the page is written
            to a temporary folder and opened in the browser.
        fields : mapping of str to (n,) array_like, optional
            More values at the vertices of the given mesh to colour by, under their names; grey
            where they are NaN, or negative integers. Of integers and truth values, which are
            labels, a face has that of one of its corners, and lines run between them over all
            colours. What `io.read_values` returns has the names of labels, too.
        texture : path-like or (height, width, 3 or 4) array_like, optional
            Image of the unit square that `packed` fills, the top row at v = 1: a png, jpeg or
            webp file, or colours from 0 to 1, such as `bake` makes.
        beside : mapping of str to (n, 2) or (n, 3) array_like, optional
            Other maps of the vertices of the given mesh, each drawn beside this one under its
            name, such as ``{"LSCM": uv}``, with the mean of its angular distortion, the SD of
            its area distortion (see `AreaDistortion`) and whether `certify` finds it valid;
            distortion is on one scale of colours. With three columns, other shapes of the surface,
            to which it can be switched, such as ``{"inflated": positions}``.
        keep : sequence of {"lengths", "areas"}, float or str
            Of the result of `disk_map` or `free_map`: what a slider goes on to, see `continued`.
        title : str
            The heading, such as the name of the surface.

        Returns
        -------
        Path
            Where the page is.

        Raises
        ------
        ValueError
            If a field or a map has not a row for each vertex, the texture is no such image, or the
            result has no `continued`.
        MapError
            If no map is certified that keeps what is asked for.
        OSError
            If the file cannot be written, or the texture not be read.
        ImportError
            If Matplotlib is not installed.

        Examples
        --------
        >>> from pathlib import Path
        >>> from tempfile import TemporaryDirectory
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> with TemporaryDirectory() as folder:
        ...     page = cdcp_igl.disk_map(V, F).view(
        ...         Path(folder, "cap.html"), fields={"height": V[:, 2]}
        ...     )
        ...     page.stat().st_size < 150_000
        True
        """
        from ..plot.viewer import show

        made = self.view_html(fields=fields, texture=texture, beside=beside, keep=keep, title=title)
        return show(made, path)

    @typed
    def view_html(
        self,
        *,
        fields: Mapping[str, Labelled] | None = None,
        texture: Texture | None = None,
        beside: Mapping[str, ArrayLike] | None = None,
        keep: Sequence[float | str] = (),
        title: str = "",
    ) -> str:
        """Return the page that `view` writes, a whole HTML document.

        Parameters
        ----------
        fields, texture, beside, keep, title
            As in `view`.

        Returns
        -------
        str

        Raises
        ------
        ValueError, MapError, OSError, ImportError
            As `view`.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> cdcp_igl.disk_map(V, F).view_html(title="Cap").count("<h1>Cap</h1>")
        1
        """
        from ..plot.viewer import page

        layout = self._layout()
        steps = self._kept_steps(keep) if keep else {"": layout}
        return page({layout.plane: layout}, fields or {}, texture, beside or {}, title, steps)

    def summary(self) -> tuple[str, Pairs]:
        """Return what printing shows: a title, and pairs of a name and what is said of it.

        Returns
        -------
        title : str
        pairs : list of (str, str)

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> title, pairs = cdcp_igl.disk_map(V, F).summary()
        >>> title
        'disk map of 331 vertices: valid'
        """
        title = f"{self._kind} map of {self._subject()}: {self.verdict}"
        left_out = [("left out", said)] if (said := self._left_out()) else []
        return title, [*self._summary(), *left_out]

    def __str__(self) -> str:
        return as_text(*self.summary())

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self._subject()}: {self.verdict}, {self._key_figure()})"

    def _repr_html_(self) -> str:
        table = as_html(*self.summary())
        if not self.valid:
            return table
        layout = self._layout()
        if len(layout.V) > MOST_VERTICES_OF_PAGES:
            from ..plot.viewer import poster

            hint = "To turn it and look closer: <code>.view()</code>, which opens the browser."
            image = f'<img alt="The surface and its image" src="{poster(layout)}">'
            return f"{table}{image}<p>{hint}</p>"
        # In a frame of its own, the page and the notebook cannot touch one another.
        frame = (
            f'<iframe srcdoc="{escape(self.view_html(), quote=True)}" '
            'title="The surface beside its image" loading="lazy" '
            'sandbox="allow-scripts allow-downloads" '
            'style="width: 100%; height: 560px; border: 0"></iframe>'
        )
        return table + frame

    def _summary(self) -> list[tuple[str, str]]:
        """Return what is printed below the title: pairs of a name and a text."""
        phases = ", ".join(f"{name} {seconds:.2f}" for name, seconds in self.timings.items())
        why = [] if self.is_acceptable else [("conformal", str(self.conformality))]
        lost = self._lost
        return [
            ("angular distortion", str(self.distortion)),
            *why,
            ("certificate", str(self.certificate)),
            *([("single precision", lost)] if lost else []),
            *([("side", side)] if (side := self.side) else []),
            *self._steps(),
            ("seconds", f"{sum(self.timings.values()):.2f} ({phases})"),
        ]

    @property
    def _lost(self) -> str:
        """Say what has no area in single precision, or nothing."""
        faces, share = self.lost_in_single_precision()
        text = f"{counted(faces, 'face', 'faces')} without area, {share:.2g} of the surface"
        return text if faces else ""

    def _facts(self, *measures: str) -> tuple[str, ...]:
        """Return what a page says below its heading: a few words each."""
        mean, sd = self.distortion.mean, self.distortion.sd
        verdict = "certified bijection" if self.valid else "NOT VALID"
        verdict += "" if self.is_acceptable else ", NOT CONFORMAL"
        return (*measures, f"angular distortion: mean {mean:.3g}°, SD {sd:.3g}°", verdict)

    def _key_figure(self) -> str:
        """Return the one figure that a representation of one line has."""
        return f"mean distortion {self.distortion.mean:.3g}°"

    def _subject(self) -> str:
        """Say what was mapped, and onto what."""
        return f"{self._size()[0]:,} vertices"

    @abstractmethod
    def _steps(self) -> list[tuple[str, str]]:
        """Return the part of the summary that only this kind of map has."""

    @abstractmethod
    def _made(self) -> dict[str, Any]:
        """Return what `how_made` does, the part of the report that is the same of all maps."""

    @abstractmethod
    def _details(self) -> dict[str, Any]:
        """Return the part of the report that only this kind of map has."""

    @abstractmethod
    def _surface(self) -> tuple[Floats, Ints]:
        """Return V and F as they are saved, in the unit in which they were given."""

    def _field(self, values: ArrayLike, method: Method | None = None) -> Field:
        """Take values at the vertices; ValueError if they are none."""
        return Field.of(values, method).of_vertices(self._size()[0])

    def _size(self) -> tuple[int, int]:
        """Return the numbers of vertices and faces."""
        V, F = self._surface()
        return len(V), len(F)

    @property
    @abstractmethod
    def _faces(self) -> Ints:
        """Those that were given."""

    @abstractmethod
    def _layout(self) -> Layout:
        """Return what is drawn."""

    def _kept_steps(self, keep: Sequence[float | str]) -> dict[str, Layout]:
        """Return what is drawn of this map and those that keep more, by what they keep."""
        raise ValueError(f"keep={keep!r} needs a map of disk_map or free_map")

    def _drawn(self, V: Floats, F: Ints, uv: Floats, *measures: str, **more: Any) -> Layout:
        """Return a layout of these arrays; `more` are other fields of it, `measures` facts."""
        rows = {"vertices": np.arange(len(V)), "faces": np.arange(len(F))}
        return Layout(
            **{"V": V, "F": F, "uv": uv, **rows, **more},
            plane=self._plane,
            distortion=self.distortion,
            flipped=len(self.certificate.flipped),
            facts=self._facts(self._subject(), *measures),
            verdict=self.verdict,
        )


Kind = TypeVar("Kind", bound=Result)


def valid_map(result: Kind, onto: str, remedy: str) -> Kind:
    """Return a map that is valid; MapError if it is not.

    The `remedy` may name what the map has, as in ``"{0.boundary}"``.
    """
    if not result.certificate.valid:
        failure = f"The map is not a bijection{onto}: {result.certificate}. {remedy.format(result)}"
        raise MapError(failure, result)
    return result


def announced(result: Kind) -> Kind:
    """Return a map that is not one of several tried, and log why it is not conformal."""
    if reasons := result.conformality.reasons:
        log.warning("the map is not conformal: %s", "; ".join(reasons))
    return result


def how_made(
    of: Any,
    boundary: BoundaryMethod,
    mobius: str,
    w: complex | None = None,
    rejected: str = "",
    reached: float = 1.0,
) -> dict[str, Any]:
    """Say how a map came about, whatever it is onto, as JSON types.

    `w` is the point of the disk that went to 0 by the Möbius transformation, None of other images;
    `rejected` and `reached` are as of a `Normalization`.
    """
    moved = None if w is None else [w.real, w.imag]
    return {
        "boundary": boundary.report(),
        "laplacian": boundary.laplacian,
        "mobius": {"method": mobius, "w": moved, "rejected": rejected, "reached": reached},
        "repair": of.repair.report(),
        "refinement": of.refinement and asdict(of.refinement),
        "solver": of.solver,
    }


def _flattened(report: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Make one dict of a nested one: keys joined by underscores, lists as short strings."""
    flat: dict[str, Any] = {}
    for key, value in report.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            flat |= _flattened(value, f"{name}_")
        elif isinstance(value, list):
            flat[name] = _spelled(value)
        else:
            flat[name] = value
    return flat


def _spelled(values: list[Any]) -> str | int:
    """Write a list as a short string; of reports, say how many there are."""
    if values and isinstance(values[0], dict):
        return len(values)
    if all(isinstance(value, str) for value in values):
        return "; ".join(values)
    return spell(np.array(values))
