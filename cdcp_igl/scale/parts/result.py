"""What `parts_map` returns: a map that lies in files, and everything one has to know about it."""

from __future__ import annotations

import errno
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, is_dataclass, replace
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from numpy.lib.format import open_memmap

from ...arguments import typed
from ...arrays import Floats, Ints, as_complex, coordinates
from ...cached import cached_property
from ...io.output import whole_file, write_text
from ...plot.layout import Layout
from ...printing import as_html
from ...result.disk_map import OntoDisk
from ...surface.location import FaceFinder
from ...verdict.distortion import AngleDistortion
from .part import Arrays, Folder, undamaged
from .parting import ROWS

RESULT = "map.json"  # comes last: what there is to know of a complete map

SQUARES, CUBES = 128, 64  # across the disk and the surface: each vertex of a view stands for one


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PartsMap(OntoDisk):
    """A disk conformal map of a surface in parts, which lies in files. Printing it gives a summary.

    Pictures and pages show a coarser surface: of the vertices in one small square of the disk, and
    in one small cube of space, one. These and the coordinates are read from the folder.

    Attributes
    ----------
    folder : Folder
        Of the parts, and of the map: ``uv-P.npy`` (k, 2) belongs to the ``vertices`` (k,) in
        ``part-P.npz``, rows of V.
    certificate, conformality, distortion, distortion_of_free_faces, solver, timings
        As of a DiskMap; of the whole.
    moved_bytes : int
        What has been written on the way.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    >>> with TemporaryDirectory() as folder:
    ...     result = cdcp_igl.parts_map(cdcp_igl.partition((V, F), Path(folder, "cap"), parts=2))
    ...     result
    PartsMap(331 vertices in 2 parts: valid, mean distortion 2.34°)
    """

    folder: Folder
    lost: tuple[int, float]
    moved_bytes: int
    _angles: AngleDistortion
    _free_angles: AngleDistortion

    @classmethod
    def read(cls, folder: Folder) -> PartsMap:
        """Read what `write` has written."""
        kinds = get_type_hints(cls)
        with undamaged(folder.work / RESULT) as file:
            given = json.load(file, object_hook=_tuples)
        for name in filter(lambda name: is_dataclass(kinds[name]), given):
            given[name] = kinds[name](**given[name])
        given["mobius"] = replace(given["mobius"], w=complex(given["mobius"].w))
        given["certificate"] = replace(given["certificate"], flipped=np.empty(0, np.int64))
        return cls(folder=folder, **given)

    def write(self, names: dict[int, str]) -> None:
        """Write it, with the coordinates by the results of the parts, and remove what led to it."""
        for p, name in names.items():
            file = BytesIO()  # to files, NumPy does not say why it cannot write
            np.save(file, coordinates(self.folder.read(name, "f")["f"]))
            with whole_file(self._file(p)) as unfinished:
                unfinished.write_bytes(file.getvalue())
        told = asdict(self)
        del told["folder"]
        told["certificate"]["flipped"] = []  # of a valid map
        told["mobius"]["w"] = str(self.mobius.w)
        text = json.dumps(told, indent=1)
        write_text(self.folder.work / RESULT, text + "\n")
        for path in self.folder.work.glob("*.npz"):
            path.unlink()

    def _file(self, p: int) -> Path:
        return self.folder.work / f"uv-{p}.npy"

    def _parts(self, *only: str) -> Iterator[tuple[Arrays, Floats]]:
        """Read each part, all or some of its arrays, and its map."""
        for p in self.folder.parts:
            try:
                part = self.folder.read(f"part-{p}", *only)
                with undamaged(self._file(p)) as file:
                    uv = np.load(file)
            except FileNotFoundError as error:
                reason = (
                    "The coordinates of a map in parts lie in its folder, and are gone. Part and "
                    "map the surface again, and assemble the map before its folder is removed"
                )
                raise FileNotFoundError(errno.ENOENT, reason, error.filename) from error
            yield part, uv

    @property
    def distortion(self) -> AngleDistortion:
        """Mean, SD and maximum of the angular distortion of the whole."""
        return self._angles

    @property
    def distortion_of_free_faces(self) -> AngleDistortion:
        """Mean, SD and maximum without the faces that the circle fixes."""
        return self._free_angles

    @cached_property
    def uv(self) -> Floats:  # type: ignore[override]
        """(n, 2) the map in memory: row i is the image of row i of V.

        FileNotFoundError if its folder is gone.
        """
        uv = np.empty((self.folder.vertices, 2))
        self._put(uv)
        return uv

    @typed
    def assemble(self, path: str | PathLike[str]) -> None:
        """Write the map to one npy file, part by part: (n, 2), row i the image of row i of V.

        Parameters
        ----------
        path : path-like
            Replaced once the new one is complete.

        Raises
        ------
        OSError
            If it cannot be written, or the folder of the map is gone.
        """
        with whole_file(path) as unfinished:
            n = self.folder.vertices
            uv = open_memmap(unfinished, "w+", np.float64, (n, 2))
            with unfinished.open("rb+") as file:  # on a full disk, mapped memory ends the process
                file.seek(uv.offset)
                for start in range(0, n, ROWS):
                    file.write(bytes(16 * min(ROWS, n - start)))
            self._put(uv)
            uv.flush()

    def _put(self, uv: Floats) -> None:
        for part, points in self._parts("vertices", "own"):
            uv[part["vertices"][part["own"]]] = points[part["own"]]

    @typed
    def save(self, path: str | PathLike[str], **image: Any) -> None:
        """Write the map to an npy file, as `assemble`; or what `DiskMap.save` says, but no surface.

        Parameters
        ----------
        path : path-like
            Named .npy; or a picture, a page or a report.
        **image
            Refused, as there is no surface to show it.

        Raises
        ------
        ValueError, OSError
            As `DiskMap.save`.
        """
        if Path(path).suffix.lower() == ".npy":
            self.assemble(path)
        else:
            super().save(path, **image)

    def lost_in_single_precision(self) -> tuple[int, float]:
        """As of a DiskMap: measured when the map is certified."""
        return self.lost

    @property
    def _faces(self) -> Ints:
        F = np.empty((self.folder.faces, 3), np.int64)
        for part, _ in self._parts("vertices", "faces", "F"):
            F[part["faces"]] = part["vertices"][part["F"]]
        return F

    def _located(self, points: Floats) -> tuple[Ints, Floats]:
        """Locate points in each part, and take the nearest."""
        face, barycentric = np.full(len(points), -1), np.full((len(points), 3), np.nan)
        away = np.full(len(points), np.inf)
        for part, uv in self._parts("faces", "F"):
            finder = FaceFinder(part["F"], as_complex(uv), inscribed=True)
            found, weights, distance = finder.locate(as_complex(points))
            here = np.flatnonzero(distance < away)
            face[here], barycentric[here] = part["faces"][found[here]], weights[here]
            away[here] = distance[here]
        return face, barycentric

    def _subject(self) -> str:
        return f"{self.folder.vertices:,} vertices in {len(self.folder.parts)} parts"

    def _steps(self) -> list[tuple[str, str]]:
        written = f"{self.moved_bytes / 2**20:,.0f} MiB written on the way"
        return [*super()._steps(), ("files", f"{self.folder.work}; {written}")]

    def _details(self) -> dict[str, Any]:
        files = {"parts": len(self.folder.parts), "moved_bytes": self.moved_bytes}
        return super()._details() | files

    def _size(self) -> tuple[int, int]:
        return self.folder.vertices, self.folder.faces

    side = ""  # of the whole, which is not here

    def _surface(self) -> tuple[Floats, Ints]:
        raise ValueError("a map in parts is written as .npy; its surface is where it came from")

    def _layout(self) -> Layout:
        """One vertex for each cell of the disk and of space, and the faces between three cells."""
        cells, triples = [], []
        for part, uv in self._parts():
            at = np.column_stack([(uv + 1) * (SQUARES / 2), (part["V"] + 1) * (CUBES / 2)])
            cell = np.floor(at).astype(np.int64) @ (2 * SQUARES) ** np.arange(5)
            cells.append(_one_each(cell, part["vertices"], part["V"], uv))
            corners = cell[part["F"]]
            key = np.sort(corners, axis=1)
            apart = (np.diff(key) > 0).all(axis=1)
            triples.append(_one_each(key[apart], corners[apart], part["faces"][apart]))
        cell, vertices, V, uv = _one_each(*map(np.concatenate, zip(*cells, strict=True)))
        _, corners, faces = _one_each(*map(np.concatenate, zip(*triples, strict=True)))
        return Layout(
            V=V,
            F=np.searchsorted(cell, corners),
            uv=uv,
            vertices=vertices,
            faces=faces,
            plane="Disk",
            distortion=self.distortion,
            flipped=len(self.certificate.flipped),
            facts=self._facts(self._subject(), f"drawn by {len(cell):,} of them"),
            verdict=self.verdict,
        )

    def _repr_html_(self) -> str:
        if not self.folder.work.exists():
            return as_html(*self.summary())
        return super()._repr_html_()


def _one_each(key: Any, *arrays: Any) -> tuple[Any, ...]:
    """Take the first row of each key, the keys ascending: keys and arrays."""
    _, first = np.unique(key, axis=0, return_index=True)
    return key[first], *(array[first] for array in arrays)


def _tuples(told: dict[str, Any]) -> dict[str, Any]:
    """Make tuples of lists, as JSON does the other way round."""
    return {key: tuple(x) if isinstance(x, list) else x for key, x in told.items()}
