"""Records of what was done to make a map."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from .errors import counted
from .options import KEPT
from .steps.center import Center
from .steps.mobius import Normalization


@dataclass(frozen=True)
class BoundaryMethod:
    """How the boundary got onto the circle.

    Attributes
    ----------
    name : str
        The method whose result was used: ``"geodesic"``, the paper's, unless something went
        wrong; else ``"harmonic measure"``, or at last ``"arc length"``, which is not conformal, or
        ``"harmonic measure and arc length"``, halfway.
        Without interior vertices ``"inscribed angles"``.
    rejected : tuple of str
        The other methods that were tried, each with the reason why its map was not used.
    n_opened : int
        Faces inscribed in the circle that had collapsed in double precision, and are held open
        by the last digits of their corners.
    laplacian : str
        Whose harmonic functions the map is made of: ``"cotangent"``, or, with the other methods,
        ``"intrinsic Delaunay"``; or ``"mean value"`` of a map that began with an embedding, from
        which shear was lowered.
    """

    name: str
    rejected: tuple[str, ...] = ()
    n_opened: int = 0
    laplacian: str = "cotangent"

    def report(self) -> dict[str, Any]:
        """Return it as JSON types, but for the Laplacian, which maps without a boundary have."""
        opened = {"rejected": list(self.rejected), "opened_faces": self.n_opened}
        return {"method": self.name, **opened}

    def __str__(self) -> str:
        laplacian = "" if self.laplacian == "cotangent" else f", {self.laplacian} Laplacian"
        faces = counted(self.n_opened, "face", "faces")
        opened = f", {faces} held open" if self.n_opened else ""
        reasons = "".join(f" (rejected {reason})" for reason in self.rejected)
        return self.name + laplacian + opened + reasons


@dataclass(frozen=True)
class Repair:
    """What was done about flipped faces.

    Attributes
    ----------
    n_flipped : int
        Faces that the harmonic map had flipped; 0 if there was nothing to do.
    n_moved : int
        Vertices that were moved, so that they are not harmonic any more, or on a free outline.
    rounds : int
        Times that patches were tried.
    """

    n_flipped: int = 0
    n_moved: int = 0
    rounds: int = 0

    def report(self) -> dict[str, int]:
        """Return it as JSON types."""
        return {
            "flipped_faces": self.n_flipped,
            "moved_vertices": self.n_moved,
            "rounds": self.rounds,
        }

    def __str__(self) -> str:
        if self.n_flipped == 0:
            return "not needed"
        flipped = counted(self.n_flipped, "flipped face", "flipped faces")
        if self.rounds == 0:
            return f"{flipped}, too many to be repaired"
        moved = counted(self.n_moved, "vertex", "vertices")
        return f"{flipped}, {moved} moved in {counted(self.rounds, 'round', 'rounds')}"


@dataclass(frozen=True)
class Straightening:
    """What was done about the shear that all faces have in common.

    Attributes
    ----------
    shear : float
        Its Beltrami coefficient |mu|; 0 where it was not worth a correction.
    before, after : float
        Mean angular distortion in degrees, over at most 30,000 faces. 0 where nothing was done.
    """

    shear: float = 0.0
    before: float = 0.0
    after: float = 0.0

    def __str__(self) -> str:
        if not self.before:
            return "not needed"
        return (
            f"common shear {self.shear:.3f}, angular distortion from {self.before:.3f} to "
            f"{self.after:.3f} degrees"
        )


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """How a map came about.

    Attributes
    ----------
    center : Center
        The central face, sect. 4.1, and how it was found.
    boundary : BoundaryMethod
        How the boundary got onto the circle, with all fallbacks.
    straightening : Straightening
        What was done about the shear that all faces have in common.
    mobius : Normalization
        The Möbius transformation (19) that was applied, or why none was.
    repair : Repair
        What was done about faces that the harmonic map had flipped.
    """

    center: Center
    boundary: BoundaryMethod
    straightening: Straightening = field(default_factory=Straightening)
    mobius: Normalization = field(default_factory=Normalization)
    repair: Repair = field(default_factory=Repair)


@dataclass(frozen=True)
class Refinement:
    """What was done to lower the angular distortion beyond that of the harmonic map.

    Attributes
    ----------
    asked : int
        Steps that were allowed, at least 1: as many as were asked for, or were due.
    steps : int
        Steps that were taken.
    stopped : str
        Why they are fewer: ``"no improvement"``; of steps that were not asked for,
        ``"little to gain"``, or ``"out of reach"`` if they cannot make the map conformal;
        ``"no certificate"`` of the map that they led to, or ``"not conformal"`` if steps would have
        taken this from the map; or ``"time limit"``. Empty if they are not fewer.
    norm : float
        The exponent p.
    before, after : float
        The objective in degrees: the power mean, with exponent p, of the angle errors of
        all corners, each at least 0.1 degree.
    """

    asked: int
    steps: int
    stopped: str
    norm: float
    before: float
    after: float

    def undone(self, why: str) -> Refinement:
        """Account for steps that were taken back."""
        return replace(self, steps=0, stopped=why, after=self.before)

    def __str__(self) -> str:
        if self.steps == 0:
            return self.stopped
        note = f" ({self.stopped})" if self.stopped else ""
        asked = counted(self.asked, "step", "steps")
        return (
            f"{self.steps} of {asked}{note}, angle errors in the {self.norm:g}-norm "
            f"from {self.before:.4f} to {self.after:.4f} degrees"
        )


@dataclass(frozen=True)
class Kept:
    """What a map keeps, and how well; on the disk, of faces that are not inscribed in the circle.

    Attributes
    ----------
    keep : float
        From 0, angles, over 1/2, lengths, to 0.99, areas.
    dirichlet : float
        The symmetric Dirichlet energy by 4, at the size where it is least: 1 for an isometry.
    texels : float
        Density of texels: how many times longer lengths are in the plane where this is so for 95
        percent of the area at most, by where it is for 5 percent. From the areas of faces.
    stretch : float
        How many times a face is longer one way than the other, at most.
    steps : int
        Steps of Newton's method.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    >>> cdcp_igl.free_map(V, F, keep="lengths").kept.name
    'lengths (0.5)'
    """

    keep: float
    dirichlet: float
    texels: float
    stretch: float
    steps: int

    @property
    def name(self) -> str:
        """What is kept, in a word or two."""
        names = {t: name for name, t in KEPT.items()}
        return f"{names[self.keep]} ({self.keep:g})" if self.keep in names else f"{self.keep:.3g}"

    def __str__(self) -> str:
        return (
            f"{self.name}: symmetric Dirichlet energy {self.dirichlet:.4g}, texel density within "
            f"{self.texels:.3g}, stretch at most {self.stretch:.3g}, {self.steps} steps"
        )
