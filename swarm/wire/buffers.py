"""Parameter vectors in memory that can be sent as it is.

Zenoh takes ``bytes`` and ``bytearray``, not arrays.  A vector of :func:`new_vector` is an array
over a bytearray, and :func:`bytes_of` finds it again: a copy of a large vector less in every round.
"""

import ctypes

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.floating]
Body = bytes | bytearray

# Unlike bytearray(size), this does not fill the memory with zeros first.
_new_bytearray = ctypes.pythonapi.PyByteArray_FromStringAndSize
_new_bytearray.restype = ctypes.py_object
_new_bytearray.argtypes = (ctypes.c_char_p, ctypes.c_ssize_t)


def new_body(length: int) -> bytearray:
    """So many bytes that are not yet anything."""
    body: bytearray = _new_bytearray(None, length)
    return body


def new_vector(size: int, dtype: np.dtype[np.floating]) -> Vector:
    """(size,) values that are not yet anything."""
    return np.frombuffer(new_body(size * dtype.itemsize), dtype)


def sum_of(a: Vector, b: Vector) -> Vector:
    """``a + b`` as a :func:`new_vector`."""
    return np.add(a, b, out=new_vector(a.size, np.result_type(a, b)))


def bytes_of(vector: Vector) -> Body:
    """Its little-endian bytes: its own memory where it can be sent, else a copy.

    They are the vector's own: who sends them no longer changes it.
    """
    little = vector.astype(vector.dtype.newbyteorder("<"), copy=False)
    memory = little.base.obj if isinstance(little.base, memoryview) else None
    if isinstance(memory, bytearray) and len(memory) == little.nbytes:
        return memory
    return little.tobytes()
