"""The triangle of least squares with many rows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = Callable[[Sequence[int]], Iterable[Array]]
"""Some columns of all rows, part by part."""
ROWS = 256
"""From which products of columns are tried."""
CACHED, PANEL = 2048, 8
"""Rows that are taken in together, which stay in the cache, and columns that are reflected so."""
LEAST_DIAGONAL = 1e-3
"""Smallest diagonal of the triangle, of columns of unit length, at which the squared condition of
products of columns leaves ten good digits."""
LEAST_REFINED = 1e-5
"""The same where a second triangle, of what the first leaves of columns, brings the digits back."""
NEAR_UNIT = 0.1
"""Largest entry by which products of all but orthonormal columns differ from the unit matrix."""
ALIKE = 1e-12
"""Cosine below one at which two columns may be the same."""
SIZES = 1e-100, 1e100
"""Lengths of columns whose products neither vanish nor overflow."""


def triangle_of_rows(columns: Array) -> Array:
    """R of columns = QR; the signs of its rows are as they come.

    By products of columns, which cost a tenth, where these keep enough digits, once or in two
    rounds; else block by block (LAPACK's `tpqrt`).

    Parameters
    ----------
    columns : ndarray, shape (n, k)

    Returns
    -------
    ndarray, shape (min(n, k), k)

    Reference
    ---------
    Demmel, Grigori, Hoemmen & Langou (2012), Communication-optimal parallel and sequential QR and
    LU factorizations, *SIAM J. Scientific Computing* 34(1), section 3; of products: Golub & Van
    Loan, *Matrix Computations*, 4th ed., §5.3.2; two rounds: Yamamoto, Nakatsukasa, Yanagisawa &
    Fukaya (2015), Roundoff error analysis of the CholeskyQR2 algorithm, *ETNA* 44.

    Example
    -------
    >>> np.abs(triangle_of_rows(np.array([[3.0], [4.0]])))
    array([[5.]])
    """
    found = _of_products(lambda: [columns]) if len(columns) >= ROWS else None
    return _row_by_row([columns]) if found is None else found


def _of_products(
    parts: Callable[[], Iterable[Array]],
    products: Array | None = None,
    columns: Columns | None = None,
) -> Array | None:
    """The triangle of all rows by products of columns; None where these lost too many digits."""
    some = columns or (lambda places: (part[:, places] for part in parts()))
    with np.errstate(over="ignore", invalid="ignore"):
        if products is None:
            products = np.sum([part.T @ part for part in parts()], axis=0)
        length = np.sqrt(np.diag(products))
    empty = length == 0.0
    if not np.all(empty | ((length > SIZES[0]) & (length < SIZES[1]))):
        return None
    if np.any(empty) and any(np.any(part[:, empty]) for part in parts()):
        return None  # whose squares underflow
    scale = np.where(empty, 1.0, length)
    scaled = products / np.outer(scale, scale)
    # Columns of zeros have an effect of zero on their own.
    scaled[empty, empty] = 1.0
    twins = _twins(scaled, some)
    if twins:
        return _with_twins(twins, products, parts, some)
    try:
        lower = np.linalg.cholesky(scaled)
    except np.linalg.LinAlgError:
        return None
    least = np.min(np.diag(lower), initial=1.0)
    if not least >= LEAST_REFINED:
        return None
    found = np.asarray(lower.T * length)
    return found if least >= LEAST_DIAGONAL else _refined(found, parts)


def _twins(scaled: Array, columns: Columns) -> dict[int, int]:
    """Columns that repeat an earlier one number by number, and which.

    The start of a state that no other state hears and the bias of an output that is that state do.
    """
    alike = np.argwhere(np.triu(scaled > 1.0 - ALIKE, 1))
    found = {int(later): int(earlier) for earlier, later in alike[::-1]}
    if not found:
        return {}
    same = np.ones(len(found), dtype=bool)
    for part in columns([*found, *found.values()]):
        same &= np.all(part[:, : len(found)] == part[:, len(found) :], axis=0)
    return {later: found[later] for later, is_twin in zip(found, same, strict=True) if is_twin}


def _with_twins(
    twins: dict[int, int],
    products: Array,
    parts: Callable[[], Iterable[Array]],
    columns: Columns,
) -> Array | None:
    """The triangle of the other columns; of one that repeats another nothing is left."""
    others = np.delete(np.arange(len(products)), list(twins))
    inner = _of_products(
        lambda: (part[:, others] for part in parts()),
        products[np.ix_(others, others)],
        lambda places: columns([int(others[place]) for place in places]),
    )
    if inner is None:
        return None
    found = np.zeros_like(products)
    found[np.ix_(others, others)] = inner
    for later, earlier in twins.items():
        found[:, later] = found[:, earlier]
    return found


def _refined(first: Array, parts: Callable[[], Iterable[Array]]) -> Array | None:
    """A triangle times that of the columns by its inverse, which are all but orthonormal."""
    if np.any(np.diag(first) == 0.0):
        return None
    inverse = np.triu(np.linalg.inv(first))
    turned = (part @ inverse for part in parts())
    products = np.sum([part.T @ part for part in turned], axis=0)
    if not np.max(np.abs(products - np.eye(len(products)))) < NEAR_UNIT:
        return None
    return np.asarray(np.linalg.cholesky(products).T @ first)


def _row_by_row(parts: Iterable[Array]) -> Array:
    """The triangle of all rows, taken in block by block: each is reflected into what there is."""
    found: Array | None = None
    for part in parts:
        k = part.shape[1]
        found = part[:0] if found is None else found
        for begin in range(0, len(part), CACHED):
            block = part[begin : begin + CACHED]
            if len(found) < max(k, 1):
                found = np.asarray(np.linalg.qr(np.concatenate([found, block]), mode="r"))
                continue
            square, rows = np.asfortranarray(found), np.array(block, order="F")
            found = scipy.linalg.lapack.dtpqrt(
                0, min(PANEL, k), square, rows, overwrite_a=1, overwrite_b=1
            )[0]
    return np.zeros((0, 0)) if found is None else found


def triangle_of_parts(
    parts: Callable[[], Iterable[Array]],
    products: Array | None = None,
    columns: Columns | None = None,
) -> Array:
    """The same of rows that come part by part, so that long columns need not stand anywhere.

    Parameters
    ----------
    parts : callable
        Gives them, each shape (n, k), and once more where their products lost too many digits.
    products : ndarray, shape (k, k), optional
        Of all columns with all, where they are known.
    columns : callable, optional
        Takes places of columns and gives these alone, part by part, each shape (n, k): columns
        that may repeat one another are compared so. Their rows may be weighed in other ways.

    Example
    -------
    >>> triangle_of_parts(lambda: [np.array([[3.0]]), np.array([[4.0]])])
    array([[5.]])
    """
    found = _of_products(parts, products, columns)
    if found is None:
        found = _row_by_row(parts())
    return found


def orthonormal(columns: Array, order: NDArray[np.intp] | None = None) -> tuple[Array, Array]:
    """Q and R of columns = QR; the signs of R's rows are as they come.

    In another `order` of the columns R is a triangle once its columns stand in it.

    By products of columns, once more of what the first round leaves, where these keep enough
    digits; else by reflections, which cost four times as much.

    Parameters
    ----------
    columns : ndarray, shape (n, k)
    order : ndarray of int, shape (k,), optional
        In which they are taken in.

    Returns
    -------
    tuple of ndarray, shapes (n, k) and (k, k)

    Reference
    ---------
    Yamamoto, Nakatsukasa, Yanagisawa & Fukaya (2015), Roundoff error analysis of the CholeskyQR2
    algorithm, *ETNA* 44.

    Example
    -------
    >>> basis, triangle = orthonormal(np.array([[3.0], [4.0]]))
    >>> np.abs(basis).ravel(), np.abs(triangle).ravel()
    (array([0.6, 0.8]), array([5.]))
    """
    if order is not None:
        found = _orthonormal(columns, order)
        return found[0], found[1][:, np.argsort(order)]
    return _orthonormal(columns, np.arange(columns.shape[1]))


def _orthonormal(columns: Array, order: NDArray[np.intp]) -> tuple[Array, Array]:
    first = None
    if len(columns) >= ROWS:
        with np.errstate(over="ignore", invalid="ignore"):
            products = (columns.T @ columns)[np.ix_(order, order)]
        first = _of_products(
            lambda: [_in_order(columns, order)],
            products,
            lambda places: [columns[:, order[places]]],
        )
    if first is None or np.any(np.diag(first) == 0.0):
        return np.linalg.qr(_in_order(columns, order))
    # Columns stay where they are: rows of the inverse stand in their order instead.
    turn = np.empty_like(first)
    turn[order] = np.triu(np.linalg.inv(first))
    basis = columns @ turn
    products = basis.T @ basis
    if not np.max(np.abs(products - np.eye(len(products))), initial=0.0) < NEAR_UNIT:
        return np.linalg.qr(_in_order(columns, order))
    second = np.linalg.cholesky(products).T
    inverse = np.triu(np.linalg.inv(second))
    for begin in range(0, len(basis), CACHED):
        basis[begin : begin + CACHED] = basis[begin : begin + CACHED] @ inverse
    return basis, np.asarray(second @ first)


def _in_order(columns: Array, order: NDArray[np.intp]) -> Array:
    """Without a copy where they stand so: long records are large."""
    return columns if np.all(np.diff(order) > 0) else columns[:, order]
