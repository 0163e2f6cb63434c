"""Searches for one question that differ in their seed, or in what they know, side by side: the first way that one finds is that of all.

How long a sampling search takes in a narrow place is a matter of luck: of several the luckiest is waited for, and seldom are all unlucky.
Source: the OR paradigm of Carpin and Pagello, "On parallel RRTs for multi-robot systems" (2002).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from typing import Generic, TypeVar

from services.planner.core.map_search import MapSearch
from services.planner.core.two_trees import Joined, TwoTrees

__all__ = ["OrParallel"]

S = TypeVar("S", bound=TwoTrees | MapSearch)


class OrParallel(Generic[S]):
    """Goes on in rounds of one slice each, and ends with the round in which a way is found; of several the first in order counts.

    So which of them is quicker makes no difference, nor how many cores there are.

    Args:
        searches: at least one; their kernels release the interpreter's lock.
        pool: with a thread for each but the first, which the caller's own thread makes.
        rounds_alone: in which the first goes on alone; what is easy is over by then, and takes longer where cores are shared.
    """

    def __init__(self, searches: Sequence[S], pool: Executor, rounds_alone: int = 0) -> None:
        self._searches, self._pool, self._rounds_alone = searches, pool, rounds_alone
        self._under_way: list[S] = list(searches)

    @property
    def iterations(self) -> int:
        """Samples of all searches so far."""
        return sum(search.iterations for search in self._searches)

    def advance(self) -> bool:
        """One round; True when the search is over."""
        n = 1 if self._rounds_alone > 0 else len(self._under_way)
        self._rounds_alone -= 1
        now, later = self._under_way[:n], self._under_way[n:]
        others = [self._pool.submit(search.advance) for search in now[1:]]
        is_over = [now[0].advance(), *(other.result() for other in others)]
        self._under_way = [*(search for search, over in zip(now, is_over, strict=True) if not over), *later]
        return not self._under_way or self.winner() is not None

    def winner(self) -> S | None:
        """The search that found a way, once it is over; None: none did within the bounds."""
        return next((search for search in self._searches if search.found() is not None), None)

    def found(self) -> Joined | None:
        """The way, once the search is over; None: there is none within the bounds."""
        winner = self.winner()
        return None if winner is None else winner.found()
