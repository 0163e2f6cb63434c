"""Two ways of planning on the same scenes: what is compared is only what both solved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.paper.ask import Answer, Variant
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, UNDECIDED, Holds
from benchmarks.paper.shared_runs import Run
from benchmarks.paper.stats import paired, sign_word

__all__ = ["Pair", "compare", "holds_of", "together"]

SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Pair:
    """A measure of way ``a`` beside that of ``b`` over the scenes that both solved, in the same order."""

    name: str
    a: tuple[float, ...]
    b: tuple[float, ...]

    @property
    def ratio(self) -> float:
        """Median of a / b; NaN without scenes."""
        return paired(self.a, self.b)[0]

    @property
    def p(self) -> float:
        """Wilcoxon's two-sided p."""
        return paired(self.a, self.b)[2]

    def ratio_word(self, digits: int) -> str:
        """The ratio, or that there was nothing to compare."""
        return f"{self.ratio:.{digits}f}" if self.a else "no scene that both solved"

    def words(self, what: str) -> str:
        """The comparison in a phrase; ``what`` is what less means: shorter, fewer."""
        ratio, n_less, p = paired(self.a, self.b)
        if not self.a:
            return f"{self.name}: no scene that both solved"
        return f"{self.name}: median ratio {ratio:.3f}, {what} in {n_less} of {len(self.a)} scenes, {sign_word(p)}"


def compare(runs: Sequence[Run], a: Variant, b: Variant, measure: Callable[[Answer], float], name: str) -> Pair:
    """The pair of two ways of planning."""
    found = {(run.variant, run.question.index): run.answer for run in runs if run.answer.solved}
    shared = sorted(index for variant, index in found if variant == a and (b, index) in found)
    return Pair(name, tuple(measure(found[a, i]) for i in shared), tuple(measure(found[b, i]) for i in shared))


def holds_of(pair: Pair) -> Holds:
    """Whether a is smaller than b, beyond chance."""
    if not pair.a or pair.p >= SIGNIFICANT:
        return UNDECIDED
    return HOLDS if pair.ratio < 1.0 else NOT


def together(parts: Sequence[Holds]) -> Holds:
    """One word for several comparisons: it holds if all hold, fails if all fail, is open if nothing is decided."""
    decided = set(parts) - {UNDECIDED}
    if not decided:
        return UNDECIDED
    if decided == {NOT}:
        return NOT
    return HOLDS if set(parts) == {HOLDS} else IN_PART
