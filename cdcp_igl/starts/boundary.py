"""What stands in for the trace: the boundary by harmonic measure, or by arc length."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

from ..arrays import Complex, Floats
from ..errors import spell
from ..solve.factored import FactoredSurface, harmonic_extension
from ..solve.solvers import factorize
from ..steps.circle import Rejected
from ..steps.trace import boundary_flux, edge_lengths, shared_by_edges
from ..surface.mesh import Mesh

# A boundary is crowded if more than MANY_CROWDED of its edges get less than the share CROWDED of
# the circle, which is a third of the distance between doubles. On a corridor n times longer than
# wide, the edges at the ends get about exp(-pi n / 2).
CROWDED = 2e-17
MANY_CROWDED = 0.03  # maps of corridors can be certified with 1 % of such edges, and not with 5 %

ROUNDS = 8  # of moving the centre: one is enough unless the first one is far off
FARTHEST = 1 - 1e-6  # that it moves in one round: faces can still be told apart there

# An edge that no heat reaches gets this part of the smaller share next to it. On scans with ears,
# whose shares are known from finer meshes of the same surface, 0.01 to 0.1 are equally good.
UNREACHED = 0.1


# Of a mesh without interior vertices no arc is shorter than this share of the average one.
LEAST_ARC = 1e-3
MOST_ROUNDS = 10  # for each arc; what is left after them, the certificate of the map judges
MOST_TRIES = 3  # to bring the number of wrong arcs down, before they are exchanged one by one
ROUNDING = 1e-13  # of half the circle


def by_harmonic_measure(surface: FactoredSurface, face: int) -> Complex:
    """Place the boundary (nB,) as it is seen from the middle of the surface; needs no curve.

    Raises `Rejected` if no corner of the central face lies inside, or many boundary vertices would
    coincide.
    """
    shares = _balanced(surface.delaunay, _shares_from(surface.delaunay, face))
    if _are_crowded(shares):
        crowded = surface.mesh.loop[shares < CROWDED]
        raise Rejected(
            f"harmonic measure: crowding, {len(crowded):,} of {len(shares):,} boundary vertices "
            f"(vertices {spell(crowded)}) closer to their neighbours than double precision can "
            "tell apart; to lower the distortion, cut the surface into shorter parts"
        )
    return around(shares)


def _shares_from(surface: FactoredSurface, face: int) -> Floats:
    """`harmonic_shares` (nB,) of a face; `Rejected` if it has none."""
    shares = harmonic_shares(surface, face)
    if not np.isfinite(shares).all():
        raise Rejected("harmonic measure: no interior vertex at the central face")
    return shares


def _are_crowded(shares: Floats) -> bool:
    return bool(np.mean(shares < CROWDED) > MANY_CROWDED)


def _balanced(surface: FactoredSurface, shares: Floats) -> Floats:
    """Harmonic measure (nB,) from where the smallest shares are as large as they can be.

    psi_w, eq. (19), multiplies short arcs at z by (1 - |w|^2) / |1 - conj(w) z|^2. The sum of
    their reciprocals, in which the smallest decide, is a linear function of the point of the
    hyperboloid that w is: it is least where w, in Klein's model of the hyperbolic plane, is
    the centre of mass of the z, weighed by the reciprocals.
    """
    for _ in range(ROUNDS):
        if not _are_crowded(shares):
            break
        f_B = around(shares)
        shorter = np.maximum(np.minimum(shares, np.roll(shares, 1)), np.finfo(float).tiny)
        klein = complex(np.average(f_B, weights=shorter.min() / shorter))
        w = klein / (1 + np.sqrt(max(1 - abs(klein) ** 2, 0)))
        w *= min(1, FARTHEST / abs(w))
        f = harmonic_extension(surface, f_B)
        moved = harmonic_shares(surface, int(abs(f[surface.mesh.F].mean(axis=1) - w).argmin()))
        if not moved.min() > shares.min():
            break
        shares = moved
    return shares


def between_the_two(surface: FactoredSurface, face: int) -> Complex:
    """Place the boundary (nB,) by the geometric mean of harmonic measure and length.

    No part is as crowded as by the one, nor as far from where it belongs as by the other. Raises
    `Rejected` if no corner of the central face lies inside.
    """
    shares, lengths = _shares_from(surface.delaunay, face), edge_lengths(surface.mesh)
    return around(np.sqrt(np.maximum(shares, CROWDED) * lengths))


def by_arc_length(surface: FactoredSurface, face: int) -> Complex:
    """Place the boundary (nB,) by its length: not conformal, but always possible.

    On very crowded surfaces it has lower angular distortion than conformal boundaries that
    are opened as far as double precision requires. `face` has no influence.
    """
    return arc_length_map(surface.mesh)


def arc_length_map(mesh: Mesh) -> Complex:
    """(nB,) boundary vertices around the circle in proportion to their distances, from 1."""
    return around(edge_lengths(mesh))


def by_inscribed_angles(mesh: Mesh) -> Complex:
    """Place the vertices (n,) of a mesh without interior ones so that its angles change least.

    All faces are inscribed in the circle, so that each angle is half the arc that the other side
    of its face cuts off: the difference of two places on half the circle. So they are found by
    least squares, whose normal matrix is the Laplacian of the edges, and no other map is better.
    """
    first, last = (mesh.loop_index[np.roll(mesh.F, -k, axis=1)].ravel() for k in (1, 2))
    angles, n = mesh.angles.ravel(), len(mesh.loop)
    # From the smaller of two places to the larger; what lies beyond the first is the rest of pi.
    wanted = np.where(first < last, angles, np.pi - angles)
    least = min(LEAST_ARC * np.pi / n, angles.min())
    rows = np.arange(len(wanted)).repeat(2)
    ends = np.sort([first, last], axis=0).T.ravel()
    differences = csr_matrix((np.tile([-1.0, 1.0], len(wanted)), (rows, ends)), (len(wanted), n))
    f = np.empty(n, dtype=np.complex128)
    f[mesh.loop] = around(np.diff(_places(differences, wanted, least), append=np.pi))
    return f


def _places(differences: csr_matrix, wanted: Floats, least: float) -> Floats:
    """Places (n,) from 0 up to pi, each at least so far from the next, by least squares.

    Arcs that would be shorter are held, those that pull at what holds them are let go, all at once,
    and one by one where that does not bring their number down: block principal pivoting. Places
    between which arcs are held move together.

    References
    ----------
    L. F. Portugal, J. J. Júdice, L. N. Vicente. A comparison of block pivoting and interior-point
    algorithms for linear least squares problems with nonnegative variables. Math. Comp. 63, 1994.
    """
    n = differences.shape[1]
    held, fewest, tries = np.zeros(n, dtype=bool), n + 1, MOST_TRIES
    for _ in range(MOST_ROUNDS * n):
        free = np.flatnonzero(~held)
        group = np.searchsorted(free, np.arange(n))  # the last is that of pi, the first that of 0
        place = least * (np.arange(n) - np.append(0, free + 1)[group])
        place[group == len(free)] = np.pi - least * (n - np.flatnonzero(group == len(free)))
        moving = np.flatnonzero((group > 0) & (group < len(free)))
        if len(moving):
            ones = np.ones(len(moving)), (moving, group[moving] - 1)
            together = differences @ csr_matrix(ones, (n, len(free) - 1))
            rest = together.T @ (wanted - differences @ place)
            place[moving] += factorize(csc_matrix(together.T @ together)).solve(rest)[ones[1][1]]
        pull = np.cumsum(differences.T @ (differences @ place - wanted))
        pull -= pull[free[0]]
        short = ~held & (np.diff(place, append=np.pi) < least - ROUNDING)
        wrong = np.flatnonzero(short | (held & (pull > ROUNDING)))
        if len(wrong) == 0:
            break
        tries = MOST_TRIES if len(wrong) < fewest else tries - 1
        fewest = min(fewest, len(wrong))
        held[wrong if tries > 0 else wrong[-1]] ^= True
    return place


# In the order in which they are tried.
FALLBACKS = {"harmonic measure": by_harmonic_measure, "arc length": by_arc_length}
# Of embeddings whose boundary then slides.
STARTS = {
    "harmonic measure": by_harmonic_measure,
    "harmonic measure and arc length": between_the_two,
    "arc length": by_arc_length,
}


def harmonic_shares(surface: FactoredSurface, face: int) -> Floats:
    """Share of the circle (nB,) that belongs to every boundary edge when a face goes to its centre.

    log|f| of a conformal map f onto the disk is harmonic, 0 on the boundary, and has its pole
    where f = 0; arg f is its conjugate. So heat that enters at the central face and leaves
    through the cold boundary does so in proportion to the angles on the circle. Without
    negative weights at interior vertices there is no negative flux (maximum principle), and
    even the smallest shares keep their digits, however crowded. Edges that no heat reaches,
    between vertices without interior neighbours, together get a tenth of the smaller share
    next to them. All are positive and they sum to 1; NaN if the face has no interior corner.

    References
    ----------
    J. B. Garnett, D. E. Marshall. Harmonic Measure. Cambridge University Press, 2005.
    """
    source = np.zeros(len(surface.mesh.scaled))
    source[surface.mesh.F[face]] = 1
    source[surface.mesh.loop] = 0
    flux = np.maximum(-boundary_flux(surface, source), 0)
    if not flux.any():
        return np.full(len(flux), np.nan)
    shares = _filled(shared_by_edges(surface.mesh, surface.mesh.loop, flux))
    return shares / shares.sum()


def _filled(shares: Floats) -> Floats:
    """Give each run of zeros a tenth of the smaller of the positive shares at its ends."""
    known = np.flatnonzero(shares > 0)
    if len(known) == len(shares):
        return shares
    last = np.searchsorted(known, np.arange(len(shares)), side="right") - 1
    following = (last + 1) % len(known)
    run = (known[following] - known[last] - 1) % len(shares)
    smaller = np.minimum(shares[known[last]], shares[known[following]])
    return np.where(shares > 0, shares, UNREACHED * smaller / np.maximum(run, 1))


def around(shares: Floats) -> Complex:
    """Points on the unit circle, from 1, each followed by its share of it.

    In extended precision where the machine has it: an angle near pi is known to 4e-16 only, the
    point to 1e-16, and arcs may be as short.
    """
    longer = shares.astype(np.longdouble)
    angle = 8 * np.arctan(np.longdouble(1)) * ((np.cumsum(longer) - longer) / longer.sum())
    f_B: Complex = np.exp(1j * angle).astype(np.complex128)
    return f_B
