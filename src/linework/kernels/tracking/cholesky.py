"""Small systems of linear equations with a positive definite matrix, solved in place."""

from __future__ import annotations

import math

from numba import njit

from linework.arrays import FloatArray


@njit(cache=True, nogil=True)
def factor(matrix: FloatArray) -> None:
    """Replace the lower triangle of a positive definite matrix by its Cholesky factor."""
    n = len(matrix)
    for a in range(n):
        for b in range(a + 1):
            total = matrix[a, b]
            for c in range(b):
                total -= matrix[a, c] * matrix[b, c]
            if a == b:
                matrix[a, a] = math.sqrt(max(total, 1e-12))
            else:
                matrix[a, b] = total / matrix[b, b]


@njit(cache=True, nogil=True)
def solve(lower: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Write the solution of a system whose matrix has this Cholesky factor."""
    n = len(lower)
    for a in range(n):
        total = right[a]
        for c in range(a):
            total -= lower[a, c] * out[c]
        out[a] = total / lower[a, a]
    for a in range(n - 1, -1, -1):
        total = out[a]
        for c in range(a + 1, n):
            total -= lower[c, a] * out[c]
        out[a] = total / lower[a, a]
