"""Searches for one question that differ in their seed, or in what they know, side by side: the first way that one finds is that of all.

How long a sampling search takes in a narrow place is a matter of luck: of several the luckiest is waited for, and seldom are all unlucky.
Source: the OR paradigm of Carpin and Pagello, "On parallel RRTs for multi-robot systems" (2002).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from operator import methodcaller

from services.planner.core.map_search import MapSearch
from services.planner.core.two_trees import Joined, TwoTrees

__all__ = ["OrParallel"]


class OrParallel:
    """Goes on in rounds of one slice each, and ends with the round in which a way is found; of several the first in order counts.

    So which of them is quicker makes no difference, nor how many cores there are.

    Args:
        searches: at least one; their kernels release the interpreter's lock.
        pool: with a thread for each of them.
    """

    def __init__(self, searches: Sequence[TwoTrees | MapSearch], pool: Executor) -> None:
        self._searches, self._pool = searches, pool
        self._under_way: list[TwoTrees | MapSearch] = list(searches)

    @property
    def iterations(self) -> int:
        """Samples of all searches so far."""
        return sum(search.iterations for search in self._searches)

    def advance(self) -> bool:
        """One round; True when the search is over."""
        is_over = list(self._pool.map(methodcaller("advance"), self._under_way))
        self._under_way = [search for search, over in zip(self._under_way, is_over, strict=True) if not over]
        return not self._under_way or self.found() is not None

    def found(self) -> Joined | None:
        """The way, once the search is over; None: there is none within the bounds."""
        return next((found for search in self._searches if (found := search.found()) is not None), None)
