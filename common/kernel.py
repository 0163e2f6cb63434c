"""The decorators of numba kernels: ``kernel``, and ``leaf`` for those that own no array, and so count no references.

Numba counts who holds an array: each time a kernel takes one out of a tuple, and with every call that numba itself inlines, a locked
counter goes up and down again, for every array in that tuple. Our kernels are told of arm, cells and map by nested tuples of some sixty
arrays. Measured on the pair tables (``common.robot.pair_tables``): one look took 400 ns with the counting and 2 ns without.

A leaf kernel is lent all its arrays by who calls it, so nothing is lost by not counting. In return it

* creates no array: numba refuses to compile ``np.empty``, a copy, arithmetic of whole arrays, or ``a[:] = b`` of arrays in it (it would
  copy ``b`` first where they might overlap: :func:`copy_row`); scratch is an argument;
* returns no array, which numba refuses too, nor takes one from what it calls: nobody would let go of it (``tests/unit/test_kernel.py``).

It may take views of what it was lent. What it calls must say by ``kernel`` that it counts, or it would not: numba hands that down.

A call has its price, too: of an arm alone 400 words are handed over, some 50 ns. What is called for each body of a pose, and does little
more than that, is ``inlined`` into the leaf that calls it. Measured: a whole look at a pose took 4.0 us with calls and 2.3 us without.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit

__all__ = ["copy_row", "inlined", "kernel", "leaf"]


def kernel(function: Callable[..., Any]) -> Any:
    """Compile ``function``: kept on disk, without the interpreter's lock."""
    return njit(cache=True, nogil=True, _nrt=True)(function)


def leaf(function: Callable[..., Any]) -> Any:
    """Compile ``function`` as a leaf: a kernel without reference counts."""
    return njit(cache=True, nogil=True, _nrt=False)(function)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile ``function`` as a leaf, into each leaf that calls it instead of by itself; for leaves alone to call."""
    return njit(inline="always", cache=True, nogil=True, _nrt=False)(function)


@leaf
def copy_row(source, target):  # type: ignore[no-untyped-def]
    """``target[:] = source`` of (n,) arrays that do not overlap."""
    for i in range(len(source)):
        target[i] = source[i]
