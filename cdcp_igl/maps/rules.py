"""When a map is good, when another start is tried, and how far a map is refined: all such rules.

Errors are mean angle errors in degrees, parts are parts of all vertices or faces. The command
``python -m benchmarks ablation`` measures what the bounds decide.
"""

from __future__ import annotations

from ..descent.schedules import GOOD
from ..options import Options
from ..result.disk_map import DiskMap
from ..result.made import MadeMap

# -- which map is better --------------------------------------------------------------

# A map that is not conformal has to be better than one that is by this factor.
MARGIN = 1.05
# A Möbius transformation for even areas may raise the error by this part of it.
PRICE_OF_AREA = 0.05

# -- when flipped faces are repaired, and when that makes another map of it ------------

# Where a larger part of the faces is flipped, other starts come before repair: on slivers the
# intrinsic Delaunay Laplacian has a hundredth of the flipped faces of the cotangent one.
FEW_FLIPPED = 0.003
# Where repair has moved a larger part of the vertices, the mean error shows it.
REPAIRED = 0.01
# Where it has moved more than this, faces that it has barely opened may hold descent up.
HEAVILY_REPAIRED = 0.05

# -- how many steps of refinement there are, if none are asked for ---------------------

# A map is not near the conformal one if its error is more than this times the error that the scale
# explains; or, as on coarse meshes, if it is more than so many degrees.
FAR, COARSE = 1.05, 6.0
# It has so many steps at least and at most; each further one has to gain this part of the error.
FIRST_STEPS, MOST_USUAL_STEPS, WORTH_A_STEP = 2, 9, 0.02
# So many at most has a map that is not conformal, that comes from a Tutte embedding, or that is
# repaired. They are counted, not timed, so that equal inputs have equal outputs.
MOST_STEPS = 60
# Maps of large faces that are stretched by less have no other map with an error lower by 5 %.
LITTLE_STRETCH = 1.6


def rank(made: MadeMap) -> tuple[bool, float]:
    """Order maps: valid ones come first, then those of low error."""
    return not made.valid, made.distortion.mean * (1 if made.is_acceptable else MARGIN)


def repaired_part(made: MadeMap) -> float:
    """Return which part of the vertices repair has moved."""
    return made.repair.n_moved / len(made.mesh.scaled)


def is_heavily_repaired(made: MadeMap) -> bool:
    """Whether descent from a Tutte embedding may lead nearer to the conformal map.

    It may where repair has moved many vertices; but not where the errors that are left belong to
    single faces.
    """
    return repaired_part(made) > HEAVILY_REPAIRED and made.conformality.mean > GOOD


def default_steps(made: MadeMap, coarse: float = COARSE) -> int:
    """Return how many steps of refinement a map gets if none are asked for."""
    verdict = made.conformality
    if verdict.reasons or repaired_part(made) > REPAIRED or made._from_tutte:
        return MOST_STEPS
    is_far = verdict.excess > FAR or verdict.mean > coarse
    return MOST_USUAL_STEPS if is_far or made._straightened else 0


def steps_of(made: MadeMap, options: Options, coarse: float = COARSE) -> int:
    """Return how many steps of refinement a map gets: those asked for, or more by default."""
    if not made.valid or options.refine == 0 or options.kept:
        return 0
    return max(options.refine or 0, 0 if options.preset else default_steps(made, coarse))


def may_be_improved(made: DiskMap, options: Options) -> bool:
    """Whether another start may lead nearer to the conformal map than this harmonic map.

    It may if there is shear, or the scale is not smooth; or if the central face lies at the
    boundary, where a dipole has no room. Errors that large faces explain are no reason.
    """
    if options.preset == "paper":
        return made.conformality.sheared
    mesh = made.mesh
    at_boundary = mesh.on_boundary[mesh.F[made.center.face]].any()
    return made.conformality.is_doubtful or bool(at_boundary)


def needs_no_other_start(made: DiskMap) -> bool:
    """Whether no other start may lead nearer to the conformal map than this refined map."""
    if made.refinement is not None and made.refinement.stopped == "not conformal":
        return False
    if is_heavily_repaired(made):
        return False
    verdict = made.conformality
    hardly_stretched = made.valid and not verdict.sheared and verdict.stretch <= LITTLE_STRETCH
    return hardly_stretched or (made.is_acceptable and not verdict.is_doubtful)
