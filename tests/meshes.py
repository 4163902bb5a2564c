"""Meshes built in code: small disks, and one nasty mesh for each way to fail."""

import numpy as np
from surfaces import sheet, torus, tube

TRIANGLE = ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
TWO_TRIANGLES = ([[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])


def fan(n=7, height=0.4):
    """One interior vertex, n on the boundary."""
    t = 2 * np.pi * np.arange(n) / n
    V = np.column_stack([np.cos(t), np.sin(t) * 0.8, 0.1 * np.cos(3 * t)])
    F = [[n, i, (i + 1) % n] for i in range(n)]
    return np.vstack([V, [0, 0, height]]), np.array(F)


def strip(n=6):
    """No interior vertex: a zigzag of n triangles."""
    i = np.arange(n + 2)
    V = np.column_stack([i / 2, i % 2, 0.1 * np.sin(i)])
    F = np.column_stack([i[:-2], i[1:-1], i[2:]])
    F[1::2] = F[1::2, ::-1]
    return V, F


def cells(rows, columns):
    """A plane rectangle of so many vertices: x and y, and two triangles for each cell."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    F = np.stack([np.stack([a, b, c]), np.stack([a, c, d])])
    return x.ravel(), y.ravel(), F.transpose(0, 2, 3, 1).reshape(-1, 3)


def grid(rows=6, columns=8, seed=0):
    """A bumpy rectangle, vertices jittered."""
    rng = np.random.default_rng(seed)
    x, y, F = cells(rows, columns)
    V = np.column_stack([x, y, 0.3 * np.sin(x + 0.5 * y)])
    V[:, :2] += rng.uniform(-0.2, 0.2, (len(V), 2))
    return V, F


def ear_at_a_hole():
    """A grid without the faces around a vertex, but for one; and that face."""
    V, F = grid()
    star = np.flatnonzero((F == 19).any(axis=1))
    return V, np.delete(F, star[1:], axis=0), star[0]


def edge_across_a_hole():
    """A grid with an ear at a hole that has a vertex in its middle; the edge it hangs on."""
    V, F, ear = ear_at_a_hole()
    (a, b), middle = F[ear][F[ear] != 19], V[F[ear]].mean(axis=0)
    split = [np.where(F[ear] == corner, len(V), F[ear]) for corner in F[ear]]
    return np.vstack([V, middle]), np.vstack([np.delete(F, ear, axis=0), split]), [[a, b]]


def _tetrahedron():
    V = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    return V, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def _annulus(n=8):
    V, F = tube(2, n)
    return V * np.repeat([[1], [2]], n, axis=0), F


def _moebius_strip(n=9):
    t, s = np.tile(2 * np.pi * np.arange(n) / n, 2), np.repeat([-0.3, 0.3], n)
    r = 1 + s * np.cos(t / 2)
    V = np.column_stack([r * np.cos(t), r * np.sin(t), s * np.sin(t / 2)])
    return V, sheet(n, 1, lambda i, j: i % n + n * np.where(i < n, j, 1 - j))


def _torus_with_hole():
    V, F = torus(6, 6)
    return V, F[1:]


def _hanging_tetrahedron():
    """A fan whose middle vertex is the tip of a closed surface."""
    V, F = fan(6)
    W, G = _tetrahedron()
    return np.vstack([V, W[1:] + V[6]]), np.vstack([F, np.where(G == 0, 6, G + 6)])


def _merged(V, F, keep, drop):
    """One vertex in place of two; `drop` must be the last row."""
    return V[:drop], np.where(drop == F, keep, F)


def _swapped(V, F, i, j):
    """The same mesh with two vertices renumbered."""
    order = np.arange(len(V))
    order[[i, j]] = order[[j, i]]
    return V[order], order[F]


def _with(V, F, vertices=(), faces=()):
    return (
        np.vstack([V, np.reshape(vertices, (-1, 3))]),
        np.vstack([F, np.reshape(faces, (-1, 3))]).astype(int),
    )


def _edited(array, where, value):
    array = array.copy()
    array[where] = value
    return array


V, F = grid()
N, M = len(V), len(F)
CORNER_0 = np.flatnonzero((F == 0).any(axis=1))

# What is wrong: the defect that must be named, the mesh, the rows that must be named.
NASTY = {
    "ragged V": ("not numeric", [[0, 0, 0], [1, 0], [0, 1, 0]], [[0, 1, 2]], []),
    "ragged F": ("not numeric", V, [[0, 1, 2], [0, 1]], []),
    "complex V": ("not numeric", V + 1j, F, []),
    "boolean F": ("not numeric", V, F > 3, []),
    "None": ("not numeric", None, None, []),
    "empty V": ("shape of V", [], F, []),
    "one-dimensional V": ("shape of V", V.ravel(), F, []),
    "four columns": ("shape of V", np.hstack([V, V[:, :1]]), F, []),
    "two vertices": ("shape of V", V[:2], [[0, 1, 0]], []),
    "empty F": ("shape of F", V, [], []),
    "quads": ("shape of F", V, np.hstack([F, F[:, :1]]), []),
    "V and F in the wrong order": ("V and F swapped", F, V, []),
    "NaN": ("non-finite coordinate", _edited(V, (5, 1), np.nan), F, [5]),
    "index n": ("index out of range", V, _edited(F, (2, 1), N), [2]),
    "negative index": ("index out of range", V, _edited(F, (4, 0), -1), [4]),
    "one-based": ("index out of range", V, F + 1, np.flatnonzero((F == N - 1).any(axis=1))),
    "NaN index": ("index out of range", V, np.where(F == 0, np.nan, F), CORNER_0),
    "huge unsigned index": (
        "index out of range",
        V,
        np.where(F == 0, np.uint64(2**64 - 1), F.astype(np.uint64)),
        CORNER_0,
    ),
    "fraction": ("fractional index", V, F + np.where(F == 0, 0.5, 0), CORNER_0),
    "repeated corner": ("repeated corner", V, _edited(F, (7, 1), F[7, 0]), [7]),
    "unreferenced": ("unreferenced vertex", *_with(V, F, vertices=[9, 9, 9]), [N]),
    "a face twice": ("duplicate face", *_with(V, F, faces=F[3]), [M]),
    "a face twice, reversed": ("duplicate face", *_with(V, F, faces=F[3, ::-1]), [M]),
    "three pages": (
        "non-manifold edge",
        *_with(*TWO_TRIANGLES, vertices=[0.5, 0.5, 1], faces=[0, 2, 4]),
        [[0, 2]],
    ),
    "reversed face": ("inconsistent orientation", V, _edited(F, 11, F[11, ::-1]), [11]),
    "Moebius strip": ("not orientable", *_moebius_strip(), []),
    "two components": (
        "several components",
        *_with(V, F, vertices=V[:3] + 100, faces=[N, N + 1, N + 2]),
        [M],
    ),
    "split vertices": (
        "several components",
        V[F].reshape(-1, 3),
        np.arange(3 * M).reshape(M, 3),
        np.arange(1, M),
    ),
    "boundary vertices merged": ("non-manifold vertex", *_merged(V, F, 0, N - 1), [0]),
    "interior vertices merged": (
        "non-manifold vertex",
        *_merged(*_swapped(V, F, 37, N - 1), 10, N - 1),
        [10],
    ),
    "hanging tetrahedron": ("several components", *_hanging_tetrahedron(), np.arange(6, 10)),
    "bow tie": (
        "several components",
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]],
        [[0, 1, 2], [0, 3, 4]],
        [1],
    ),
    "closed": ("closed surface", *_tetrahedron(), []),
    "annulus": ("several boundary loops", *_annulus(), np.arange(8)),
    "handle": ("handle", *_torus_with_hole(), []),
    "all in one point": ("degenerate face", 0 * V, F, np.arange(M)),
    "on a line": ("degenerate face", [[0, 0, 0], [1, 1, 1], [3, 3, 3]], [[0, 1, 2]], [0]),
    "sliver": ("degenerate face", [[0, 0, 0], [1, 0, 0], [0.5, 1e-11, 0]], [[0, 1, 2]], [0]),
}

# Of these, defects of the arrays: there is no surface that could be mended or cut.
BAD_ARRAYS = {
    *("not numeric", "shape of V", "shape of F", "V and F swapped"),
    *("index out of range", "fractional index"),
}


def corridor(length, width=4):
    """Rectangle `length` times longer than wide."""
    x, y, F = cells(width + 1, width * length + 1)
    return np.column_stack([x, y]), F


def prism(sides, height):
    """Open below, closed above by a fan from a vertex on the rim."""
    i = np.arange(sides)
    j, lid = (i + 1) % sides, sides + i[1:-1]
    z = np.exp(2j * np.pi * i / sides)
    V = [np.column_stack([z.real, z.imag, np.full(sides, h)]) for h in (0, height)]
    wall = [np.column_stack([i, j, sides + j]), np.column_stack([i, sides + j, sides + i])]
    F = np.vstack([*wall, np.column_stack([np.full(sides - 2, sides), lid, lid + 1])])
    return np.vstack(V), F


def rugged(seed):
    """A surface that rises and falls by more than its edges are long."""
    V, F = grid(16, 16)
    V = np.column_stack([V[:, :2], np.random.default_rng(seed).normal(size=len(V))])
    return V * [1, 1, 3], F
