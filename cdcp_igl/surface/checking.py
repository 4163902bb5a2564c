"""What a mesh is: a triangulated disk or not, with all its defects, and how to go on."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..defects import CLEAN, CUT, DEFECTS, IN_PYTHON, IN_SHELL, as_commands
from ..errors import Defect, counted, spell
from ..io.given import OfGiven, takes_meshes
from ..io.polygons import in_polygons
from ..printing import as_html
from .orientation import INWARD, wrong_side
from .topology import Edges, rim_pairs, sewn
from .validation import examine

NEAR = 0.01  # of the shortest edge


@dataclass(frozen=True, eq=False)
class MeshReport(OfGiven):
    """What `check` found. Printing it gives a line for each defect, and the way to go on.

    Attributes
    ----------
    n_vertices, n_faces : int
        Rows of V and of F; 0 where the array is unusable.
    n_boundary : int
        Vertices on the outer boundary loop, the one that reaches farthest; 0 where there
        is none, or `n_loops` is None.
    ears : (k,) ndarray of int64
        Faces with two boundary edges. Legal, but all three corners of an ear lie on the
        circle, so its angles are distorted whatever the method.
    chords : (k, 2) ndarray of int64
        Interior edges that join two boundary vertices, the smaller index first. Legal;
        ears lie behind chords, and so do longer parts of the surface.
    n_components : int
        Components of faces that share edges; 0 where the surface could not be examined.
    n_loops : int or None
        Boundary loops of all components; None unless the surface is a manifold with two
        sides, once its faces are oriented alike.
    genus : int or None
        Handles of all components; None as for `n_loops`.
    near : (int, float)
        Pairs of boundary vertices that lie within a small part of the shortest edge there, but not
        at one place, and the distance within which all do, in the unit of V: perhaps a seam.
    side : str
        ``"faces point inward"``, of closed components; ``"faces are clockwise"``, of a mesh in a
        plane z = const, seen from above; empty where neither is known. No defect: maps are seen
        from the side that faces point to, and say so.
    defects : tuple of Defect
        Everything that keeps the mesh from being a disk; empty for a disk.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    >>> report = cdcp_igl.check(V, F)
    >>> report.is_disk, report.n_vertices, report.n_boundary
    (True, 91, 30)
    >>> print(cdcp_igl.check(V, F[1:]).kind)
    genus 0, 2 boundary loops
    """

    n_vertices: int
    n_faces: int
    n_boundary: int = 0
    ears: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    chords: Ints = field(default_factory=lambda: np.empty((0, 2), np.int64))
    n_components: int = 0
    n_loops: int | None = None
    genus: int | None = None
    defects: tuple[Defect, ...] = ()
    near: tuple[int, float] = (0, 0.0)
    side: str = ""
    _seams: bool = False  # whether vertices are there twice along them

    @property
    def is_disk(self) -> bool:
        """True if the mesh can be mapped."""
        return not self.defects

    @property
    def kind(self) -> str:
        """The class of the surface in words, whatever other defects it has."""
        if self.n_components == 0:
            return "not a triangle mesh"
        several = f"{self.n_components:,} components, " if self.n_components > 1 else ""
        if self.n_loops is None or self.genus is None:
            one_sided = "not orientable" in {defect.name for defect in self.defects}
            return several + ("one-sided" if one_sided else "not a manifold")
        if not several and (self.genus, self.n_loops) == (0, 1):
            return "disk"
        loops = counted(self.n_loops, "boundary loop", "boundary loops")
        return f"{several}genus {self.genus:,}, {loops if self.n_loops else 'closed'}"

    @property
    def next_step(self) -> str:
        """The call, and the command, that goes on from here."""
        return self._next_step(in_shell=False)

    def _next_step(self, in_shell: bool) -> str:
        if self.is_disk:
            return _step(in_shell, disk_map="maps it")
        for defect in self.defects:
            row = DEFECTS[defect.name]
            flat = defect.name == "degenerate face" and len(defect.indices) == self.n_faces
            if flat or not row.by:
                return defect.remedy_in_shell if in_shell else defect.remedy
        names = [defect.name for defect in self.defects]
        rows = [DEFECTS[name] for name in names]
        mends, cuts = {"clean": "mends it"}, {"surface_map": "cuts it open and maps it"}
        if self.kind == "genus 0, closed" and names == ["closed surface"]:
            return _step(in_shell, sphere_map="maps it onto a sphere", **cuts)
        if self.kind == "genus 0, 2 boundary loops" and names == ["several boundary loops"]:
            mends["annulus_map"] = "maps it onto a ring"
        # Elsewhere what is left after cleaning may be closed, or have handles.
        sure = self.genus is not None and self.n_components == 1 and not self._seams
        if sure and all(CLEAN in row.by for row in rows):
            return _step(in_shell, **mends, **(cuts if self.kind != "disk" else {}))
        if all(CUT in row.by for row in rows):
            return _step(in_shell, **cuts)
        return _step(in_shell, clean_and_cut="mend it, and map what is left")

    def report(self) -> dict[str, Any]:
        """Return all of it.

        Returns
        -------
        dict
            JSON types.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
        >>> cdcp_igl.check(V, F).report()["kind"]
        'disk'
        """
        return {
            "disk": self.is_disk,
            "kind": self.kind,
            "vertices": self.n_vertices,
            "faces": self.n_faces,
            "vertices_left_out": self.left_out,
            "boundary_vertices": self.n_boundary,
            "components": self.n_components,
            "boundary_loops": self.n_loops,
            "genus": self.genus,
            "ears": self.ears.tolist(),
            "chords": self.chords.tolist(),
            "defects": [
                {
                    "name": defect.name,
                    "what": defect.what,
                    "remedy": defect.remedy,
                    "of": defect.kind,
                    "indices": defect.indices.tolist(),
                }
                for defect in self.defects
            ],
            "near_pairs": self.near[0],
            "near_within": self.near[1],
            "side": self.side,
            "next_step": self.next_step,
        }

    @property
    def _size(self) -> str:
        size = f"{self.n_vertices:,} vertices, {counted(self.n_faces, 'face', 'faces')}"
        return f"{size} ({said} left out)" if (said := self._left_out()) else size

    def __repr__(self) -> str:
        found = "a disk" if self.is_disk else ", ".join(d.name for d in self.defects)
        return f"MeshReport({self._size}: {found})"

    def _repr_html_(self) -> str:
        rows = [
            ("kind", self.kind),
            ("boundary vertices", f"{self.n_boundary:,}"),
            ("ears", f"{len(self.ears):,}"),
            ("chords", f"{len(self.chords):,}"),
            *((defect.name, str(defect)) for defect in self.defects),
            ("next", self.next_step),
        ]
        return as_html(self._size, rows)

    def __str__(self) -> str:
        return self._text(in_shell=False)

    @property
    def in_shell(self) -> str:
        """What `str` gives, with the remedies on the command line, of a file IN."""
        return self._text(in_shell=True)

    def _text(self, in_shell: bool) -> str:
        # Where there are loops of which nothing is known, 0 would be wrong.
        border = "" if self.n_loops is None else f"{self.n_boundary:,} boundary vertices, "
        counts = (
            f"{self._size}, {border}{counted(len(self.ears), 'ear', 'ears')}"
            + (f" (faces {spell(self.ears)})" if len(self.ears) else "")
            + f", {counted(len(self.chords), 'chord', 'chords')}"
            + (f" (edges {spell(self.chords)})" if len(self.chords) else "")
        )
        if self.is_disk:
            verdict = "A triangulated disk."
        elif self.kind == "disk":
            verdict = "A disk by its topology, but not fit for a map:"
        else:
            verdict = f"Not a triangulated disk: {self.kind}."
        found = [f"- {d.name}: {d.in_shell if in_shell else d}" for d in self.defects]
        if self.near[0]:
            said = hint(*self.near)
            found.append(f"- seam: {as_commands(said) if in_shell else said}")
        if self.side:
            turns = (IN_SHELL if in_shell else IN_PYTHON)["clean"]
            remedy = f"{turns} turns them outward" if self.side == INWARD else "F[:, ::-1] are not"
            found.append(f"- side: {self.side}; {remedy}.")
        return "\n".join([counts, verdict, *found, f"Next: {self._next_step(in_shell)}"])


def hint(count: int, within: float) -> str:
    """Say that vertices may be there twice, and what merges them."""
    pairs = counted(count, "pair of boundary vertices lies", "pairs of boundary vertices lie")
    return f"{pairs} within {within:g}: {IN_PYTHON['within']}{within:g} sews them."


def near_pairs(V: Floats, edges: Edges, exponent: int) -> tuple[int, float]:
    """How many boundary vertices nearly coincide, and within what distance in the unit given."""
    _, apart = rim_pairs(V, edges, np.inf, NEAR)
    if len(apart) == 0:
        return 0, 0.0
    return len(apart), float(10 ** np.ceil(np.log10(np.ldexp(apart.max(), exponent))))


def _step(in_shell: bool, **what: str) -> str:
    """Say which function goes on and what it does; in the shell the whole command."""
    if in_shell:
        return "; or: ".join(f"{IN_SHELL[call]} IN OUT" for call in what)
    said = [f"{IN_PYTHON[call]} {does} ({IN_SHELL[call]})" for call, does in what.items()]
    return "; or: ".join(said) + "."


@takes_meshes
def check(V: ArrayLike, F: ArrayLike, *, polygon_of_face: Ints | None = None) -> MeshReport:
    """Examine a mesh and report every defect; raise nothing.

    Parameters
    ----------
    V, F
        As in `disk_map`, whatever surface they are.
    polygon_of_face : (m,) ndarray of integers, optional
        Which polygon each face is a part of, as in `cut`; then defects name polygons.

    Returns
    -------
    MeshReport
        Counts, class and defects, and how to go on. A defect of F (shape, type, index range)
        hides those of the surface, and a non-manifold edge hides those of the boundary: mend
        it and check again.

    Examples
    --------
    >>> import cdcp_igl
    >>> report = cdcp_igl.check([[0, 0], [1, 0], [0, 1], [1, 1]], [[0, 1, 2]])
    >>> print(report.defects[0].name, report.defects[0].indices)
    unreferenced vertex [3]
    >>> print(report.next_step)
    cdcp_igl.clean mends it (cdcp-igl map --clean).
    """
    found = examine(V, F)
    surface = found.surface
    defects = found.defects
    if polygon_of_face is not None:
        defects = in_polygons(defects, polygon_of_face)
    report = MeshReport(found.n_vertices, found.n_faces, defects=defects)
    if surface is None:
        return report
    in_sheets = not surface.singular.any()
    return replace(
        report,
        n_boundary=len(found.loops[0]) if found.loops else 0,
        ears=surface.ears if in_sheets else report.ears,
        chords=surface.chords if in_sheets else report.chords,
        n_components=surface.components[0],
        n_loops=None if surface.genus is None else len(surface.loops),
        genus=surface.genus,
        near=near_pairs(found.V, surface.edges, found.exponent),
        side=wrong_side(found.V, surface)[0],
        _seams=bool(found.defects) and sewn(found.V, surface.F)[1] > 0,
    )
