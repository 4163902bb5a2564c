"""Surfaces that are no disk: random ones of any genus, and some whose cut is known."""

import igl
import numpy as np
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from cdcp_igl import datasets


def voxels(seed, size=4, share=0.5, missing=0):
    """The surface of a random set of cubes: closed, oriented, of random genus, in parts.

    Cubes that touch in an edge or a corner make edges of four faces and vertices where several
    fans meet. Some faces may be missing, which makes boundary loops.
    """
    rng = np.random.default_rng(seed)
    solid = rng.random((size,) * 3) < share
    if not solid.any():
        solid[0, 0, 0] = True
    V, F = skin(solid)
    F = np.delete(F, rng.permutation(_plain(F))[:missing], axis=0)
    used, faces = np.unique(F, return_inverse=True)
    return V[used] + rng.uniform(-0.2, 0.2, (len(used), 3)), faces.reshape(F.shape)


def random_sphere(rng, n):
    """The hull of n random points of the unit sphere, which need not surround 0; faces outwards."""
    V = rng.normal(size=(n, 3))
    V /= np.linalg.norm(V, axis=1)[:, None]
    hull = ConvexHull(V)
    F = hull.simplices.astype(np.int64)
    normal = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    outwards = (normal * hull.equations[:, :3]).sum(axis=1) > 0
    return V, np.where(outwards[:, None], F, F[:, ::-1])


def star(seed, n):
    """A sphere of n random vertices, at random distances from its centre."""
    rng = np.random.default_rng(seed)
    V, F = random_sphere(rng, n)
    return V * rng.uniform(0.2, 3, (n, 1)), F


def random_voxels(size):
    """Such surfaces of at most so many cubes along an axis, as a strategy."""
    share, missing = st.floats(0.2, 0.9), st.integers(0, 12)
    return st.builds(voxels, st.integers(0, 10_000), st.integers(1, size), share, missing)


def assert_glues_back(cut, V, F):
    """The rows of a surface that was cut open are those of the given one."""
    np.testing.assert_array_equal(np.asarray(V, float)[cut.vertex_index], cut.V)
    np.testing.assert_array_equal(cut.vertex_index[cut.F], F)


def skin(solid):
    """The surface of a set of cubes, given as a three-dimensional array of bool."""
    solid = np.pad(solid, 1)
    corner = np.arange(np.prod(np.add(solid.shape, 1))).reshape(np.add(solid.shape, 1))
    quads = []
    for axis in range(3):
        step = np.eye(3, dtype=int)[axis]
        u, v = (np.eye(3, dtype=int)[(axis + k) % 3] for k in (1, 2))
        for side in (0, 1):
            cells = np.argwhere(solid & ~np.roll(solid, 1 - 2 * side, axis=axis))
            base = cells + side * step
            ring = [base, base + u, base + u + v, base + v]
            quads.append(np.column_stack([corner[tuple(p.T)] for p in ring[:: 1 if side else -1]]))
    quads = np.vstack(quads)
    F = np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    used, faces = np.unique(F, return_inverse=True)
    return np.argwhere(corner >= 0)[used] - 1.0, faces.reshape(F.shape)


def interfaces(seed, size, labels=1):
    """The faces between random cubes of different labels, wound at random; half of them one by one.

    With one label they are closed; with more, edges of three faces are among them.
    """
    rng = np.random.default_rng(seed)
    cubes = (rng.random((size,) * 3) < 0.5) * rng.integers(1, labels + 1, (size,) * 3)
    cubes[0, 0, 0] = 1
    cubes, quads = np.pad(cubes, 1), []
    for axis in range(3):
        u, v = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
        base = np.argwhere(cubes != np.roll(cubes, -1, axis)) + np.eye(3, dtype=int)[axis]
        quads.append(np.stack([base, base + u, base + u + v, base + v], 1))
    V, i = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    corners = i.reshape(-1, 4)
    F = np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])
    return V.astype(float), turned_over(rng, F, len(F) // (1 + seed % 2))


def book(seed, pages):
    """Pages that share a spine, their faces wound at random."""
    rng = np.random.default_rng(seed)
    angle = np.repeat(2 * np.pi * np.arange(pages) / pages, 8)
    r, z = np.tile(np.repeat([1, 2], 4), pages), np.tile(np.arange(4), 2 * pages)
    V = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
    spine = np.column_stack([np.zeros((4, 2)), np.arange(4)])
    F = [
        sheet(2, 3, lambda i, j, page=page: np.where(i, 4 + 8 * page + 4 * (i - 1), 0) + j)
        for page in range(pages)
    ]
    return np.vstack([spine, V]), turned_over(rng, np.vstack(F), 6 * pages)


def turned_over(rng, F, groups):
    """Faces of which random ones are reversed, those alike that are so many rows apart."""
    turned = np.resize(rng.random(groups) < 0.5, len(F))
    return np.where(turned[:, None], F[:, ::-1], F)


def arms(length, width):
    """Three arms of cubes, with a face taken out at the end of one."""
    solid = np.zeros((2 * length + width, length + width, width), dtype=bool)
    solid[:, :width] = solid[length : length + width] = True
    V, F = skin(solid)
    at_the_end = (V[F, 0] == 0).all(axis=1)
    return V, np.delete(F, at_the_end.argmax(), axis=0)


def _plain(F):
    """Faces all of whose edges have two faces: without one the others are still oriented."""
    edges = np.sort(np.stack([F, np.roll(F, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    _, edge, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    return np.flatnonzero((count[edge.reshape(F.shape)] == 2).all(axis=1))[:-1]


def sheet(n, k, at):
    """Triangles of n by k cells; the corner (i, j) of one is the vertex at(i, j)."""
    i, j = (g.ravel() for g in np.meshgrid(np.arange(n), np.arange(k), indexing="ij"))
    a, b, c, d = (at(i + di, j + dj) for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def parameters(n, k):
    """Angles of n by k vertices, once around each."""
    i, j = np.divmod(np.arange(n * k), k)
    return 2 * np.pi * i / n, 2 * np.pi * j / k


def torus(n=12, k=8, thickness=0.4):
    """Closed, genus 1: n vertices along, k around."""
    s, t = parameters(n, k)
    r = 1 + thickness * np.cos(t)
    V = np.column_stack([r * np.cos(s), r * np.sin(s), thickness * np.sin(t)])
    return V, sheet(n, k, lambda i, j: i % n * k + j % k)


def sphere(rings=10, around=16, stretch=1.0):
    """Closed, genus 0: circles of latitude and two poles, which are the last two vertices."""
    _, t = parameters(rings, around)
    z = np.repeat(np.cos(np.pi * np.arange(1, rings + 1) / (rings + 1)), around)
    r = np.sqrt(1 - z**2)
    V = np.column_stack([r * np.cos(t), r * np.sin(t), z])
    k = np.arange(around)
    north = np.column_stack([np.full(around, len(V)), k, (k + 1) % around])
    south = north[:, [0, 2, 1]] + [1, len(V) - around, len(V) - around]
    wall = sheet(rings - 1, around, lambda i, j: i * around + j % around)
    V = np.vstack([V, [0, 0, 1], [0, 0, -1]])
    return V * [1, 1, stretch], np.vstack([wall, north, south])


def pierced_sphere():
    """A sphere with four holes."""
    V, F = sphere(12, 20)
    used, faces = np.unique(F[~np.isin(F, [0, 105, 119, 200]).any(axis=1)], return_inverse=True)
    return V[used], faces.reshape(-1, 3)


def tube(n=24, k=12, length=4.0):
    """An open cylinder of radius 1: two boundary loops."""
    s, t = parameters(n, k)
    t = t - np.pi * np.arange(n).repeat(k) / k
    V = np.column_stack([np.cos(t), np.sin(t), length * n / (n - 1) * s / (2 * np.pi)])
    return V, sheet(k, n - 1, lambda j, i: i * k + j % k)


def klein_bottle(n=10, k=8):
    """Closed and one-sided; it goes through itself in space, which no triangle notices."""
    s, t = parameters(n, k)
    r = 2 + np.cos(s / 2) * np.sin(t) - np.sin(s / 2) * np.sin(2 * t)
    h = np.sin(s / 2) * np.sin(t) + np.cos(s / 2) * np.sin(2 * t)
    V = np.column_stack([r * np.cos(s), r * np.sin(s), h])
    # After one turn t has become -t.
    return V, sheet(n, k, lambda i, j: i % n * k + np.where(i < n, j, -j) % k)


def soup(V, F):
    """Each face with corners of its own."""
    return np.asarray(V)[F].reshape(-1, 3), np.arange(np.size(F)).reshape(-1, 3)


def dual(V, F):
    """A closed surface of polygons, one around each vertex of V through the centres of F."""
    after = {}  # the face that follows around a vertex, and the one that follows that
    for face, corners in enumerate(np.asarray(F).tolist()):
        for a, b, c in (corners, corners[1:] + corners[:1], corners[2:] + corners[:2]):
            after[a, b] = face, c
    polygons, first = [], {}
    for a, b in after:
        first.setdefault(a, b)
    for a, b in sorted(first.items()):
        polygon, at = [], b
        while not polygon or at != b:
            face, at = after[a, at]
            polygon.append(face)
        polygons.append(polygon)
    return V[F].mean(axis=1), polygons


def blob(seed, subdivisions=3):
    """A closed surface: an icosahedron, subdivided, with bumps."""
    V, F = igl.upsample(*igl.icosahedron(), subdivisions)
    V /= np.linalg.norm(V, axis=1)[:, None]
    rng = np.random.default_rng(seed)
    bumps = np.cos(4 * V @ rng.normal(size=(3, 4)) + rng.uniform(0, 6, 4)).sum(axis=1)
    return V * (1 + 0.08 * bumps)[:, None], F


def capped_tube(around=16, along=60):
    """A tube closed at one end, twelve times longer than wide."""
    V, F = tube(along, around, 0.4 * (along - 1))
    tip, end = np.full(around, len(V)), np.arange(around)
    cap = np.column_stack([np.roll(end, -1), end, tip])
    return np.vstack([V, [0, 0, -0.5]]), np.vstack([F, cap])


def ring(rows, around, profile):
    """A surface of revolution from ``profile(0)`` to ``profile(1)``, radius and height."""
    i, j = (grid.ravel() for grid in np.indices((rows + 1, around)))
    t = 2 * np.pi * (j + i % 2 / 2) / around
    r, z = profile(i / rows)
    V = np.column_stack([r * np.cos(t), r * np.sin(t), z])
    at = np.arange(len(V)).reshape(rows + 1, around)
    a, b, c, d = at[:-1], np.roll(at, -1, 1)[:-1], at[1:], np.roll(at, -1, 1)[1:]
    odd = (np.arange(rows) % 2 == 1)[:, None, None]
    first = np.where(odd, np.stack([a, b, d], 2), np.stack([a, b, c], 2))
    second = np.where(odd, np.stack([a, d, c], 2), np.stack([b, d, c], 2))
    return V, np.concatenate([first, second]).reshape(-1, 3), t


def cup(n=12, height=0.05, neck=(0.5, 1.0)):
    """A tube that narrows to another one, its bottom a fan of needles, as CAD programs write it."""
    turn = 2 * np.pi * np.arange(n) / n
    radius, top = neck
    profile = [(1.0, 0.0), (1.0, height), (radius, height), (radius, height + top)]
    V = [[r * np.cos(t), r * np.sin(t), z] for r, z in profile for t in turn]
    bottom = [[0, k + 1, k] for k in range(1, n - 1)]
    k, after = np.arange(n), np.roll(np.arange(n), -1)
    sides = [
        [[a + k, a + after, b + after], [a + k, b + after, b + k]]
        for a, b in ((0, n), (n, 2 * n), (2 * n, 3 * n))
    ]
    return np.array(V), np.vstack(
        [bottom, *(np.array(side).transpose(0, 2, 1).reshape(-1, 3) for side in sides)]
    )


def needles(seed, n):
    """A narrow wavy strip, many vertices at its sides and few in between."""
    random = np.random.default_rng(seed)
    few = max(2, int(n * random.uniform(0.05, 0.3)))
    x, y = np.linspace(0, 1, n), np.linspace(0, 1, few)
    waves = np.sin(6 * x + random.uniform(0, 6)), random.normal(size=few), np.cos(9 * x)
    rows = [(x, 0.0, waves[0]), (y, 0.05, waves[1]), (x, 0.1, waves[2])]
    V = np.vstack([np.column_stack([along, 0 * along + at, 0.2 * z]) for along, at, z in rows])
    F = []
    for one, other, k, m in ((0, n, n, few), (n, n + few, few, n)):
        i = j = 0
        while i < k - 1 or j < m - 1:
            if j == m - 1 or (i < k - 1 and (i + 1) / (k - 1) <= (j + 1) / (m - 1)):
                F.append([one + i, one + i + 1, other + j])
                i += 1
            else:
                F.append([one + i, other + j + 1, other + j])
                j += 1
    return V, np.array(F)


def spiky_ring(seed, n=12, spikes=4):
    """A square with spikes, up to five times as high as it is wide, without one vertex."""
    V, F, _ = datasets.square(n)
    rng, xy = np.random.default_rng(seed), V[:, :2] / abs(V).max()
    height = np.zeros(len(V))
    for _ in range(spikes):
        at, width = rng.uniform(-0.8, 0.8, 2), rng.uniform(0.05, 0.2)
        height += rng.uniform(0.3, 5) * np.exp(-((xy - at) ** 2).sum(axis=1) / width**2)
    hole = len(V) // 2 + 3
    F = F[(hole != F).all(axis=1)]
    return np.delete(np.column_stack([xy, height]), hole, axis=0), F - (hole < F)
