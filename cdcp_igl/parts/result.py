"""What `parts_map` returns: a map that lies in files, and everything one has to know about it."""

from __future__ import annotations

import errno
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.format import open_memmap

from ..arrays import Floats, Ints
from ..cached import cached_property
from ..certificate import Certificate
from ..distortion import AngleDistortion
from ..io.output import whole_file, write_text
from ..plot.layout import Layout
from ..printing import as_html
from ..rescue.boundary import BoundaryMethod
from ..rescue.conformality import Conformality
from ..rescue.repair import Repair
from ..result.disk_map import OntoDisk
from ..steps.center import Center
from ..steps.mobius import Normalization
from .part import Arrays, Folder
from .parting import ROWS

RESULT = "map.json"  # comes last: what there is to know of a complete map

# What is written of a map: results of a kind of their own, and numbers and texts.
KINDS: dict[str, Any] = {
    "certificate": Certificate,
    "conformality": Conformality,
    "distortion": AngleDistortion,
    "distortion_of_free_faces": AngleDistortion,
    "center": Center,
    "boundary": BoundaryMethod,
    "mobius": Normalization,
    "repair": Repair,
}
PLAIN = ("solver", "timings", "lost", "moved_bytes")

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

    @classmethod
    def read(cls, folder: Folder) -> PartsMap:
        """Read what `write` has written."""
        told = json.loads((folder.work / RESULT).read_text())
        given = {name: kind(**_tuples(told[name])) for name, kind in KINDS.items()}
        given |= _tuples({name: told[name] for name in PLAIN})
        mobius, certificate = given["mobius"], given["certificate"]
        given["mobius"] = replace(mobius, w=complex(*mobius.w))
        given["certificate"] = replace(certificate, flipped=np.array(certificate.flipped, np.int64))
        return cls(folder=folder, **given)

    def write(self) -> None:
        """Write everything but the coordinates as JSON, and remove what led to the map."""
        told = {name: asdict(getattr(self, name)) for name in KINDS}
        told |= {name: getattr(self, name) for name in PLAIN}
        told["mobius"]["w"] = [self.mobius.w.real, self.mobius.w.imag]
        text = json.dumps(told, indent=1, default=np.ndarray.tolist)
        write_text(self.folder.work / RESULT, text + "\n")
        for file in self.folder.computed():
            file.unlink()

    def _parts(self, *only: str) -> Iterator[tuple[Arrays, Floats]]:
        """Read each part, all or some of its arrays, and its map."""
        for p in self.folder.leaves:
            try:
                part, uv = self.folder.part(p, *only), self.folder.uv(p)
            except FileNotFoundError as error:
                reason = (
                    "The coordinates of a map in parts lie in its folder, and are gone. Part and "
                    "map the surface again, and assemble the map before its folder is removed"
                )
                raise FileNotFoundError(errno.ENOENT, reason, error.filename) from error
            yield part, uv

    @cached_property
    def uv(self) -> Floats:  # type: ignore[override]
        """(n, 2) the map in memory: row i is the image of row i of V.

        FileNotFoundError if its folder is gone.
        """
        uv = np.empty((self.folder.manifest["vertices"], 2))
        self._put(uv)
        return uv

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
            n = self.folder.manifest["vertices"]
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

    def save(self, path: str | PathLike[str]) -> None:
        """Write the map to an npy file, as `assemble`; or what `DiskMap.save` says, but no surface.

        Parameters
        ----------
        path : path-like
            Named .npy; or a picture, a page or a report.

        Raises
        ------
        ValueError, OSError
            As `DiskMap.save`.
        """
        if Path(path).suffix.lower() == ".npy":
            self.assemble(path)
        else:
            super().save(path)

    def lost_in_single_precision(self) -> tuple[int, float]:
        """As of a DiskMap: measured when the map is certified."""
        return self.lost

    def _subject(self) -> str:
        return f"{self.folder.manifest['vertices']:,} vertices in {len(self.folder.leaves)} parts"

    def _steps(self) -> list[tuple[str, str]]:
        written = f"{self.moved_bytes / 2**20:,.0f} MiB written on the way"
        return [*super()._steps(), ("files", f"{self.folder.work}; {written}")]

    def _details(self) -> dict[str, Any]:
        return {
            **super()._details(),
            "parts": len(self.folder.leaves),
            "moved_bytes": self.moved_bytes,
        }

    def _size(self) -> tuple[int, int]:
        return self.folder.manifest["vertices"], self.folder.manifest["faces"]

    def _surface(self) -> tuple[Floats, Ints]:
        raise ValueError("a map in parts is written as .npy; its surface is where it came from")

    @cached_property
    def _coarse(self) -> Layout:
        """One vertex for each cell of the disk and of space, and the faces between three cells."""
        gathered = []
        for part, uv in self._parts():
            at = np.column_stack([(uv + 1) * (SQUARES / 2), (part["V"] + 1) * (CUBES / 2)])
            cell = np.floor(at).astype(np.int64) @ (2 * SQUARES) ** np.arange(5)
            found, first = np.unique(cell, return_index=True)
            vertices = found, part["vertices"][first], part["V"][first], uv[first]
            i, j, k = corners = cell[part["F"]].T
            apart = (i != j) & (j != k) & (k != i)
            turned = corners.T[apart]
            start = turned.argmin(axis=1)[:, None]
            turned = np.take_along_axis(turned, (start + np.arange(3)) % 3, axis=1)
            once, one = np.unique(turned, axis=0, return_index=True)
            gathered.append((*vertices, once, part["faces"][apart][one]))
        cells, rows, V, uv, triples, faces = map(np.concatenate, zip(*gathered, strict=True))
        found, first = np.unique(cells, return_index=True)
        once, one = np.unique(triples, axis=0, return_index=True)
        return Layout(
            V=V[first],
            F=np.searchsorted(found, once),
            uv=uv[first],
            vertices=rows[first],
            faces=faces[one],
            plane="Disk",
            distortion=self.distortion,
            flipped=len(self.certificate.flipped),
            facts=self._facts(self._subject(), f"drawn by {len(found):,} of them"),
        )

    def _layout(self) -> Layout:
        return self._coarse

    def _repr_html_(self) -> str:
        if not self.folder.work.exists():
            return as_html(*self.summary())
        return super()._repr_html_()


def _tuples(told: dict[str, Any]) -> dict[str, Any]:
    """Make tuples of lists, as JSON does the other way round."""
    return {key: tuple(x) if isinstance(x, list) else x for key, x in told.items()}
