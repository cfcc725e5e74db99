"""Small linear systems with a symmetric positive definite matrix, as least squares leads to.

`factor` and `solve` take any size, by Cholesky's method. For two and three unknowns the solution is written out:
the kernels that need it call it for every point of a survey.
"""

from __future__ import annotations

import math

from numba import njit

from linework.arrays import FloatArray

#: Smallest pivot: a matrix that rounding has made singular is taken for regular.
LEAST_PIVOT = 1e-12


@njit(cache=True, nogil=True)
def factor(matrix: FloatArray) -> None:
    """Replace the lower triangle of a positive definite matrix (n, n) by its Cholesky factor."""
    n = len(matrix)
    for a in range(n):
        for b in range(a + 1):
            total = matrix[a, b]
            for c in range(b):
                total -= matrix[a, c] * matrix[b, c]
            if a == b:
                matrix[a, a] = math.sqrt(max(total, LEAST_PIVOT))
            else:
                matrix[a, b] = total / matrix[b, b]


@njit(cache=True, nogil=True)
def solve(lower: FloatArray, right: FloatArray, out: FloatArray) -> None:
    """Write the solution (n,) of a system with right side (n,) whose matrix has this Cholesky factor (n, n)."""
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


@njit(cache=True, nogil=True)
def solve_two(aa: float, ab: float, bb: float, ra: float, rb: float) -> tuple[float, float]:
    """Return the two unknowns of the symmetric system ((aa, ab), (ab, bb)) x = (ra, rb), by Cramer's rule."""
    det = aa * bb - ab * ab
    return (ra * bb - rb * ab) / det, (rb * aa - ra * ab) / det


@njit(cache=True, nogil=True)
def inverse_of_three(
    aa: float, ab: float, ac: float, bb: float, bc: float, cc: float
) -> tuple[float, float, float, float, float, float]:
    """Return the inverse of a symmetric 3 x 3 matrix, as its upper triangle by rows; by cofactors."""
    c00, c01, c02 = bb * cc - bc * bc, ac * bc - ab * cc, ab * bc - ac * bb
    c11, c12, c22 = aa * cc - ac * ac, ab * ac - aa * bc, aa * bb - ab * ab
    det = aa * c00 + ab * c01 + ac * c02
    return c00 / det, c01 / det, c02 / det, c11 / det, c12 / det, c22 / det
