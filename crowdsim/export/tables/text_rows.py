"""Turn columns of numbers and words into text, whole columns at once, without a loop over rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Bytes = NDArray[np.uint8]
"""Characters of a column (R, width); zeros mean no character."""

_TENS = (1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6)
"""Powers of ten, by exponent."""

_ZERO, _MINUS, _POINT = b"0"[0], b"-"[0], b"."[0]


def whole_numbers(values: ArrayLike) -> Bytes:
    """Return integers (R,) in decimal."""
    return decimals(np.asarray(values, np.int64), 0)


def decimals(values: ArrayLike, places: int) -> Bytes:
    """Return finite numbers (R,) with ``places`` decimal places, at most six, as characters (R, width) uint8.

    With 0 places they must be integers, which are taken as they are, exact also beyond 2**53. In the result, 0 stands
    for no character: in place of the sign of positive numbers, and before numbers with fewer digits.
    """
    given = np.asarray(values)
    if not np.isfinite(given).all():
        raise ValueError("a text of numbers cannot hold what is not finite")
    scaled = np.rint(given.astype(np.float64) * _TENS[places]).astype(np.int64) if places else given.astype(np.int64)
    left = np.abs(scaled)
    width = max(len(str(int(left.max(initial=0)))), places + 1)
    digits = np.empty((len(left), width), np.uint8)
    for column in range(width - 1, -1, -1):
        left, digit = np.divmod(left, 10)
        digits[:, column] = digit + _ZERO
    # Leading zeros are removed, except the one before the decimal point.
    leading = np.logical_and.accumulate(digits[:, : width - places - 1] == _ZERO, axis=1)
    digits[:, : width - places - 1][leading] = 0
    sign = np.where(scaled < 0, _MINUS, 0).astype(np.uint8)[:, None]
    if not places:
        return np.concatenate([sign, digits], axis=1)
    point = np.full((len(digits), 1), _POINT, np.uint8)
    return np.concatenate([sign, digits[:, : width - places], point, digits[:, width - places :]], axis=1)


def words(codes: ArrayLike, texts: Sequence[str]) -> Bytes:
    """Return the text of each of ``codes`` (R,), indices into ``texts``, in UTF-8: (R, width) uint8."""
    # Bytes of the longest text; shorter ones are filled up with zeros, which mean no character.
    table = np.array([text.encode() for text in texts] or [b""], np.bytes_)
    width = max(table.dtype.itemsize, 1)
    return table.astype(f"S{width}").view(np.uint8).reshape(len(table), width)[np.asarray(codes, np.int64)]


def text_rows(columns: Sequence[Bytes], separator: str, end: str = "\n") -> bytes:
    """Return one line for each row of all ``columns``, which are joined by ``separator``; zeros are left out."""
    count = len(columns[0])
    parts: list[Bytes] = []
    for column in columns:
        parts += [column, _repeated(separator, count)]
    parts[-1] = _repeated(end, count)
    joined = np.concatenate(parts, axis=1)
    return bytes(joined[joined != 0])


def _repeated(text: str, count: int) -> Bytes:
    """Return a column of ``count`` rows that all hold ``text``."""
    return np.broadcast_to(np.frombuffer(text.encode(), np.uint8), (count, len(text.encode())))
