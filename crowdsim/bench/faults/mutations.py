"""Damage files at random."""

from __future__ import annotations

import re
from pathlib import Path

import h5py
import numpy as np

_NUMBERS = (b"nan", b"-inf", b"1e999", b"1e9", b"-1", b"0", b"99999999999999999999", b"1e-9", b"3", b"0.37")
_TOKENS = (
    *_NUMBERS,
    b"",
    b"{",
    b"}",
    b"\xff\xfe",
    b"[",
    b"*x",
    b"null",
    b"0x7f",
    b"\t",
)


def mutated(content: bytes, rng: np.random.Generator, text: bool = False) -> bytes:
    """Return ``content`` with one to four faults: bytes changed, parts lost, doubled or zeroed, the end cut off.

    In ``text``, numbers and words are replaced, too. Half of all texts, at random, get one other number alone, so that
    mostly their meaning can be refused, not their syntax.
    """
    # Kinds: 0 changes up to eight bytes, 1 cuts off the end, 2 loses a part, 3 doubles it, 4 zeroes it, 5 replaces a
    # word, 6 a number. A part has up to 64 bytes.
    numbers = text and rng.random() < 0.5
    for _ in range(1 if numbers else int(rng.integers(1, 5))):
        kind = 6 if numbers else int(rng.integers(7 if text else 5))
        at = int(rng.integers(max(len(content), 1)))
        size = int(rng.integers(1, 65))
        if kind == 0:
            changed = bytearray(content)
            for place in rng.integers(max(len(content), 1), size=int(rng.integers(1, 9))).tolist():
                changed[place : place + 1] = bytes([int(rng.integers(256))])
            content = bytes(changed)
        elif kind == 1:
            content = content[:at]
        elif kind == 2:
            content = content[:at] + content[at + size :]
        elif kind == 3:
            content = content[:at] + content[at : at + size] + content[at:]
        elif kind == 4:
            content = content[:at] + b"\0" * size + content[at + size :]
        else:
            words = [word.span() for word in re.finditer(rb"[\w.+-]+" if kind == 5 else rb"\d[\d.eE+-]*", content)]
            if words:
                begin, end = words[int(rng.integers(len(words)))]
                tokens = _NUMBERS if numbers else _TOKENS
                token = tokens[int(rng.integers(len(tokens)))]
                if numbers and rng.random() < 0.5:  # a number of usual size, near the first digit
                    token = b"%.3f" % (float(content[begin : begin + 1]) + rng.uniform(-1.0, 1.0))
                content = content[:begin] + token + content[end:]
    return content


def mutate_parts(path: Path, rng: np.random.Generator) -> None:
    """Delete one to three datasets of an HDF5 file, or give them another type, another shape, or values of any size."""
    with h5py.File(path, "r+", locking=False) as file:
        names: list[str] = []
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        for _ in range(int(rng.integers(1, 4))):
            name = names[int(rng.integers(len(names)))]
            if name in file:
                _mutate_part(file, name, rng)


def _mutate_part(file: h5py.File, name: str, rng: np.random.Generator) -> None:
    """Damage the dataset ``name``: delete it, or change its length, shape, type or content.

    Scalars, texts and empty datasets are not changed but replaced by something else.
    """
    values = file[name][()]
    kind = int(rng.integers(5))
    if kind == 0:
        del file[name]
        return
    # The attributes are lost, too.
    if not isinstance(values, np.ndarray) or values.dtype == object or values.size == 0:
        del file[name]
        file[name] = ("nan", 7, [1.5, 2.5], [["a"]])[int(rng.integers(4))]
        return
    if kind == 1:
        values = values[: len(values) // 2] if rng.random() < 0.5 else np.concatenate([values, values])
    elif kind == 2:
        values = values.reshape(-1) if values.ndim > 1 else values.reshape(-1, 1)
    elif kind == 3:
        values = values.astype(("<f8", "<i8", "<u1", "S5")[int(rng.integers(4))])
    else:
        some = rng.integers(values.size, size=int(rng.integers(1, 9)))
        extremes = np.array([-(2.0**31), -2.0, -1.0, 1e3, 1e5, 2.0**31 - 1.0, np.nan, np.inf])
        with np.errstate(invalid="ignore"):
            values.flat[some] = extremes[rng.integers(len(extremes), size=len(some))].astype(values.dtype)
    attributes = dict(file[name].attrs)
    del file[name]
    file[name] = values
    file[name].attrs.update(attributes)
