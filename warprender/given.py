"""What users hand over, checked: fields of descriptions, faces, numbers. A complaint is a few words, without a name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import MISSING, fields

import numpy as np
import warp as wp


def fault_of_fields(thing: object, varying: type | tuple[type, ...] = (), unbounded: tuple[str, ...] = ()) -> str:
    """What is wrong with a dataclass's fields, as "roughness is 'low', not a number", or "".

    A field holds what its default does: a number, a tuple of so many numbers, a truth value or a text. Numbers are
    finite unless the default is not. Fields without such a default are left to the class.

    Args:
        thing: the object.
        varying: types of values that may stand for numbers.
        unbounded: names of fields that may be infinite.
    """
    for field in fields(thing):
        value, like = getattr(thing, field.name), field.default
        if like is MISSING or like is None or isinstance(value, varying):
            continue
        if wanted := _wanted(value, like, field.name in unbounded):
            return f"{field.name} is {shown(value)}, not {wanted}"
    return ""


def fault_of_matrix(name: str, value: object) -> str:
    """What is wrong with a (4, 4) array of numbers, or ""."""
    good = isinstance(value, np.ndarray) and value.shape == (4, 4) and value.dtype.kind in "fiu"
    return "" if good else f"{name} is {shown(value)}, not a (4, 4) array"


def is_number(value: object) -> bool:
    """Whether it is one real number, NaN and the infinities among them."""
    return _kind(value) in ("b", "i", "u", "f") and np.ndim(value) == 0


def is_count(value: object, least: int = 0) -> bool:
    """Whether it is a whole number that fits into an int32, of any type, from `least` on."""
    return is_number(value) and math.isfinite(value) and int(value) == value and least <= value < 2**31


def shown(value: object) -> str:
    """A value in a message: one short line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def shared_rows(values: object, dtype: type) -> object:
    """An array of another library, PyTorch's or JAX's, as the `wp.array` over the same memory; all else as it is.

    Args:
        values: anything. Rows (N, C) of float32, one behind the other, are shared by DLPack; what lies otherwise is
            left to be copied.
        dtype: the Warp type of a row, as `wp.vec3` or `wp.transformf`.
    """
    if isinstance(values, (wp.array, np.ndarray)) or not hasattr(values, "__dlpack__"):
        return values
    wp.init()
    try:
        found = wp.from_dlpack(values)
    except (RuntimeError, TypeError, ValueError, BufferError) as error:
        raise ValueError(f"an array of {type(values).__module__} cannot be shared: {error}") from None
    width = dtype._length_
    if found.dtype != wp.float32 or found.ndim != 2 or found.shape[1] != width or not found.is_contiguous:
        return values
    return wp.from_dlpack(values, dtype=dtype)


def numbers(name: str, values: object) -> np.ndarray:
    """Real numbers as a float32 array of any shape.

    Raises:
        ValueError: they are none, or lists of different lengths.
    """
    array = plain_array(values)
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} is {shown(values)}, not an array of numbers")
    with np.errstate(over="ignore"):
        return array.astype(np.float32)


def plain_array(values: object) -> np.ndarray:
    """An array, of objects where the values make no other."""
    if isinstance(values, wp.array):
        return values.numpy()
    try:
        return np.asarray(values)
    except (TypeError, ValueError, RuntimeError):
        return np.empty((), object)


def face_corners(faces: object) -> tuple[np.ndarray, np.ndarray]:
    """Corners of each face (F,) and the indices of all in a row, int64.

    Args:
        faces: (F, k) ints, a sequence of F faces of any sizes, or the indices of triangles in a row (3 F,).

    Raises:
        ValueError: they are nothing of the kind.
    """
    faces = faces if isinstance(faces, (np.ndarray, wp.array, Sequence)) else _listed(faces)
    array = plain_array(faces)
    if array.size == 0 and array.dtype != object:
        return np.full(len(array) if array.ndim else 0, 0, np.int64), np.zeros(0, np.int64)
    if array.dtype.kind in "iu":
        if array.ndim == 1 and len(array) % 3 == 0:
            array = array.reshape(-1, 3)
        if array.ndim == 2:
            return np.full(len(array), array.shape[1], np.int64), _as_int64(array)
        raise ValueError(f"faces have the shape {array.shape}, not (F, k)")
    rows = [plain_array(face) for face in faces] if array.dtype == object and not isinstance(faces, str) else []
    bad = next((k for k, row in enumerate(rows) if row.ndim != 1 or (row.size and row.dtype.kind not in "iu")), None)
    if not rows or bad is not None:
        at = f"[{bad}]" if rows else ""
        raise ValueError(f"faces{at} is {shown(faces[bad] if rows else faces)}, not a row of ints")
    return np.array([len(row) for row in rows], np.int64), np.concatenate([_as_int64(row) for row in rows])


def _listed(faces: object) -> list:
    try:
        return list(faces)
    except TypeError:
        raise ValueError(f"faces is {shown(faces)}, not a row of faces") from None


def _as_int64(array: np.ndarray) -> np.ndarray:
    """In a row; what int64 cannot hold is out of range as it is, and -1 says so."""
    row = array.reshape(-1)
    return np.where(row > 2**62, -1, row).astype(np.int64) if row.dtype == np.uint64 else row.astype(np.int64)


def _kind(value: object) -> str:
    return plain_array(value).dtype.kind


def _wanted(value: object, like: object, unbounded: bool) -> str:
    """What a value should have been to stand where `like` does, or "" where it is that."""
    if isinstance(like, str):
        return "" if isinstance(value, str) else "a text"
    if isinstance(like, bool):
        return "" if is_number(value) and value in (0, 1) else "True or False"
    if isinstance(like, (int, float)):
        if type(value) is float and math.isfinite(value):
            return ""
        unbounded = unbounded or math.isinf(like)
        return "" if is_number(value) and _is_allowed(value, unbounded) else "a number"
    if isinstance(like, tuple) and like and is_number(like[0]):
        array = plain_array(value)
        good = array.dtype.kind in "biuf" and array.shape == (len(like),) and _is_allowed(array, unbounded)
        return "" if good else f"{len(like)} numbers"
    return ""


def _is_allowed(value: object, unbounded: bool) -> bool:
    return bool(np.all(~np.isnan(value) if unbounded else np.isfinite(value)))
