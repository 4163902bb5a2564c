"""A part of a surface, condensed to some of its vertices: the Schur complement of its Laplacian."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix

from ..arrays import Floats, Indices, Ints, marked
from .laplacian import Laplacian
from .memory import require_memory
from .ordering import elimination_order
from .solvers import solver


class Condensed:
    """What a Laplacian is to the vertices G that are `kept`, with the others, I, eliminated.

    The rows of G come last, all of them joined, by zeros, so that their block of the factor is
    dense; and are shifted by 1, which is the size of the weights, so that a part without a
    boundary is definite, too.

    `order` (n - k,) is I in the order of elimination, `schur` (k, k) S = L_GG - L_GI L_II^-1 L_IG.
    SolverError if L_II is numerically not positive definite, or its factor cannot fit into memory.
    """

    def __init__(self, laplacian: Laplacian, V: Floats, kept: Ints) -> None:
        n, k = len(V), len(kept)
        require_memory(n)
        factorization = solver()
        rows, ordering, _ = elimination_order(laplacian, V, ~marked(n, kept), factorization)
        if ordering == "amd" and len(rows):
            rows = rows[factorization.fill_reducing_order(laplacian.block(rows))]
        self.order = rows
        self._rows: Indices = np.concatenate([rows, kept])
        self._kept = kept
        A = _joined_and_shifted(laplacian.block(self._rows), k)
        self._factor = factorization(A, "natural")
        self._shifted = self._factor.schur_complement(A, k)
        self.schur: Floats = self._shifted - np.identity(k)

    def solve(self, b: Floats) -> tuple[Floats, Floats]:
        """Solve L_II x_I = b_I for b (n,): x (n,), 0 on G, and b_G - L_GI x_I (k,)."""
        n, k = len(b), len(self._kept)
        x, b_rows = np.zeros(n), b[self._rows]
        b_rows[n - k :] = 0
        # With the shifted matrix M, M [y_I; y_G] = [b_I; 0] gives L_GI x_I = -(S + 1) y_G, and
        # M [x_I; 0] = [b_I; L_GI x_I].
        b_rows[n - k :] = pull = -self._shifted @ self._factor.solve(b_rows)[n - k :]
        x[self._rows[: n - k]] = self._factor.solve(b_rows)[: n - k]
        return x, b[self._kept] - pull


def _joined_and_shifted(lower: csc_matrix, k: int) -> csc_matrix:
    """Join the last k rows with one another, by zeros, and add 1 to their diagonal."""
    n, A = lower.shape[0], lower.tocoo()
    rows, columns = np.tril_indices(k)
    entries = np.concatenate([A.data, (rows == columns).astype(float)])
    rows = np.concatenate([A.row, rows + (n - k)])
    columns = np.concatenate([A.col, columns + (n - k)])
    return coo_matrix((entries, (rows, columns)), (n, n)).tocsc()
