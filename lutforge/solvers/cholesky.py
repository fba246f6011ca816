"""Cholesky's factorization of large dense matrices, by blocks that all cores share.

Block by block, the diagonal block is factorized, the rows below it are divided by its factor, and their products are
subtracted from what is left of the matrix (right-looking; Golub & Van Loan, Matrix Computations, 4.2.9). Each call of
BLAS and LAPACK has one thread and a size that does not depend on the cores, nor does the result. SciPy's own wrappers
hold Python's lock, so that fits beside each other would wait for each other; calls by ctypes do not.
"""

import ctypes
from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.linalg.lapack import dpotrs

from lutforge.arrays import Array
from lutforge.threads import one_blas_thread, run

BLOCK = 256
"""Rows and columns of a block."""


@one_blas_thread
def solve_positive_definite(lower: Array, right: Array) -> Array:
    """Solve K x = right (n, m), given the lower triangle of K (n, n) in a C-contiguous array, which is overwritten.

    Raises LinAlgError where K is not positive definite or holds NaN.
    """
    size = len(lower)
    for start in range(0, size, BLOCK):
        stop = min(start + BLOCK, size)
        corner, panel = lower[start:stop, start:stop], lower[:, start:stop]
        _factorize(corner)

        def divide(first: int, last: int, corner: Array = corner, panel: Array = panel) -> None:
            _divide(panel[first:last], corner)

        def subtract(first: int, last: int, panel: Array = panel, stop: int = stop) -> None:
            lower[first:last, stop:last] -= panel[first:last] @ panel[stop:last].T

        below = [(first, min(first + BLOCK, size)) for first in range(stop, size, BLOCK)]
        run(divide, below)
        run(subtract, below[::-1])  # the long rows first
    solution = np.ascontiguousarray(dpotrs(lower.T, right, lower=False)[0])
    if not np.all(np.isfinite(solution)):  # LAPACK does not look for NaN
        raise np.linalg.LinAlgError("the matrix or the right side holds NaN")
    return solution


def _factorize(block: Array) -> None:
    """Replace the lower triangle of a block (n, n) by its factor L."""
    status = ctypes.c_int(0)
    # LAPACK's columns are our rows: what it takes for the upper triangle is our lower one.
    _compiled("lapack", "dpotrf")(b"U", _int(len(block)), *_place(block), ctypes.byref(status))
    if status.value:
        raise np.linalg.LinAlgError("the matrix is not positive definite")


def _divide(rows: Array, factor: Array) -> None:
    """Replace rows A (m, n) by A L⁻ᵀ, with L the lower triangle of the factor (n, n)."""
    sizes = (_int(rows.shape[1]), _int(rows.shape[0]))
    _compiled("blas", "dtrsm")(
        b"L", b"U", b"T", b"N", *sizes, ctypes.byref(ctypes.c_double(1.0)), *_place(factor), *_place(rows)
    )


def _int(number: int) -> object:
    """A pointer to an integer."""
    return ctypes.byref(ctypes.c_int(number))


def _place(array: Array) -> tuple[object, object]:
    """The address of an array, and the distance between its rows in numbers: two arguments of BLAS."""
    return ctypes.c_void_p(array.ctypes.data), _int(array.strides[0] // array.itemsize)


@cache
def _compiled(library: str, name: str) -> Callable[..., None]:
    """A function of BLAS or LAPACK as SciPy offers it to compiled code, with pointers for arguments."""
    from numba.extending import get_cython_function_address

    return ctypes.CFUNCTYPE(None)(get_cython_function_address(f"scipy.linalg.cython_{library}", name))
