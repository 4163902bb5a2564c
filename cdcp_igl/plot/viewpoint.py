"""From where a surface shows itself best."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Ints, evenly_spaced_rows

Y_AXIS, Z_AXIS = np.array([0.0, 1, 0]), np.array([0.0, 0, 1])

OPEN = 0.5  # length of the mean normal from which one looks straight at the surface
CLOSED = 1e-9  # length of the mean normal below which it is rounding: there is no opening
DIRECTIONS = 300  # over the sphere, among which the best level one is sought
LEVEL = 0.35  # sine of the steepest of those
FACES = 20_000  # that are looked at, at most
PIXELS = 60  # across the grid on which faces hide one another


def choose_viewpoint(V: Floats, F: Ints) -> Floats:
    """Choose a viewpoint that shows the outside of a surface.

    The mean normal points away from the opening. Along it one looks at an open surface,
    with the y axis (or z) up. A surface that is nearly closed stands on its opening and
    is seen from the side: much of its outside, in relief, and little of its inside. Returns a
    rotation (3, 3) whose rows point right, up and towards the viewer.
    """
    F = F[evenly_spaced_rows(len(F), FACES)]
    i, j, k = F.T
    across = np.cross(V[j] - V[i], V[k] - V[i])
    twice_area = np.linalg.norm(across, axis=1, keepdims=True)
    mean_normal = across.sum(axis=0) / twice_area.sum()
    openness = np.linalg.norm(mean_normal)
    if openness > OPEN:
        towards = mean_normal / openness
        return _frame(towards, Y_AXIS if abs(towards @ Y_AXIS) < 0.9 else Z_AXIS)

    top = mean_normal / openness if openness > CLOSED else Y_AXIS
    directions = _sphere(DIRECTIONS)
    frames = [_frame(d, top) for d in directions[abs(directions @ top) < LEVEL]]
    centers, normals = V[F].mean(axis=1), across / twice_area
    return max(frames, key=lambda frame: _merit(centers @ frame.T, normals @ frame.T))


def _sphere(count: int) -> Floats:
    """(count, 3) directions spread evenly, by the golden angle."""
    height = 1 - (2 * np.arange(count) + 1) / count
    radius, angle = np.sqrt(1 - height**2), np.pi * (3 - np.sqrt(5)) * np.arange(count)
    return np.column_stack([radius * np.cos(angle), height, radius * np.sin(angle)])


def _frame(towards: Floats, top: Floats) -> Floats:
    """Rows right, up, towards the viewer."""
    up = top - (top @ towards) * towards
    up /= np.linalg.norm(up)
    return np.array([np.cross(up, towards), up, towards])


def _merit(seen: Floats, normals: Floats) -> float:
    """Pixels that show an outside less those that show an inside, weighted by relief."""
    low, high = seen.min(axis=0), seen.max(axis=0)
    grid = ((seen[:, :2] - low[:2]) * (PIXELS - 1) / (high - low)[:2].max()).astype(np.int64)
    pixel = grid[:, 0] * PIXELS + grid[:, 1]
    nearest = np.full(PIXELS * PIXELS, -1)
    order = np.argsort(seen[:, 2])
    nearest[pixel[order]] = order  # later, that is nearer, faces overwrite
    shown = normals[nearest[nearest >= 0]]
    relief = np.linalg.norm(np.diff(shown, axis=0), axis=1).mean()
    return float(np.sign(shown[:, 2]).sum() * relief)
