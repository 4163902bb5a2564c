"""Theodorsen's method on the exterior of a star-shaped boundary trace, by FFT.

What the geodesic algorithm is compared with: on a curve with a known map, medians of 3 in one
run, that takes 0.23 s and this 0.17 s for 3,987 points, 1.0 and 0.7 s for 10,000, and the
error of the geodesic algorithm is a ninth.
"""

from __future__ import annotations

import numpy as np

from cdcp_igl.arrays import Complex, Floats

__all__ = ["theodorsen_map"]

OVERSAMPLING = 8  # grid points a vertex, at least
ROUNDS = 200
TOLERANCE = 1e-12


def theodorsen_map(z: Complex) -> Complex | None:
    """Map the exterior of a nearly circular curve about 0 onto the disk, infinity to 0.

    Parameters
    ----------
    z : (N,) complex128
        Points along a **clockwise** curve, star-shaped about 0.

    Returns
    -------
    (N,) complex128 or None
        Their images on the unit circle, counterclockwise; None where the curve is not
        star-shaped or the iteration does not converge.

    References
    ----------
    M. H. Gutknecht. Numerical conformal mapping methods based on function conjugation.
    J. Comput. Appl. Math. 14, 1986.
    """
    # Seen in a mirror the curve is counterclockwise: phi grows along it.
    phi = np.angle(z.conj()[0]) + np.concatenate([[0], np.cumsum(np.angle(z[:-1] * z[1:].conj()))])
    steps = np.diff(phi, append=phi[0] + 2 * np.pi)
    if not ((steps > 0) & (steps < np.pi)).all():
        return None
    n = 1 << int(np.ceil(np.log2(OVERSAMPLING * max(len(z), 32))))
    theta = phi[0] + 2 * np.pi * np.arange(n) / n
    frequency = np.fft.rfftfreq(n, 1 / n)

    # g maps the exterior of the circle to that of the curve. log(g(w) / w) is analytic
    # there and real at infinity, so on the circle its imaginary part phi(theta) - theta
    # is the conjugate function of its real part log rho(phi(theta)).
    turn = np.where(frequency > 0, 1j, 0)
    turn[-1] = 0  # the alternating component has no conjugate
    offset = np.zeros(n)
    change = np.inf
    for _ in range(ROUNDS):
        log_rho = _log_radius(z, phi, theta + offset)
        image = np.fft.irfft(turn * np.fft.rfft(log_rho), n)
        # Averaging makes the iteration contract for slopes of log rho up to sqrt(3).
        previous, change = change, float(abs(image - offset).max())
        offset = (offset + image) / 2
        if change < TOLERANCE or change == previous:
            break
    correspondence = theta + offset
    if change > 1e-6 or not (np.diff(correspondence) > 0).all():
        return None
    period = np.append(correspondence, correspondence[0] + 2 * np.pi)
    lifted = (phi - correspondence[0]) % (2 * np.pi) + correspondence[0]
    angle = np.interp(lifted, period, np.append(theta, theta[0] + 2 * np.pi))
    return np.exp(1j * angle)


def _log_radius(z: Complex, phi: Floats, angle: Floats) -> Floats:
    """Logarithm of the polygon's radius in given directions."""
    lifted = (angle - phi[0]) % (2 * np.pi) + phi[0]
    edge = np.searchsorted(phi, lifted, side="right") - 1
    start, end = z.conj()[edge], np.roll(z.conj(), -1)[edge]
    ray = np.exp(1j * lifted)
    # The ray r e^{i angle} meets the line through start and end where both have the same
    # component across the edge.
    across = 1j * (end - start)
    return np.log((start * across.conj()).real / (ray * across.conj()).real)
