"""The slow, obvious twin of ``services/planner/kernels/shorten.py``."""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["kept_corners"]


def kept_corners(n_points: int, first: int, n_checks: int, is_free: Callable[[int, int], bool]) -> list[int]:
    """Points that stay: from each on the farthest one, by halving, to which the straight way is free."""
    kept = list(range(first + 1))
    while kept[-1] < n_points - 1:
        here, ahead = kept[-1], n_points - 1
        while ahead > here + 1 and n_checks > 0:
            n_checks -= 1
            if is_free(here, ahead):
                break
            ahead = here + max(1, (ahead - here) // 2)
        else:
            ahead = here + 1
        kept.append(ahead)
    return kept
