"""Types of arrays in annotations."""

from __future__ import annotations

from raff2urdf.arrays import Array, ArrayLike, Bools, Complex, Indices, Integers

__all__ = ["Array", "ArrayLike", "Bools", "Complex", "Indices", "Integers"]
