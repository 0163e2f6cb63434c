"""Numbers into words: mean and spread, shares with their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, wilcoxon

__all__ = ["mcnemar", "mean_sigma", "median", "paired", "percentile", "share", "sign_word"]

Values = Sequence[float] | NDArray[np.float64]
NOTHING = "–"


def mean_sigma(values: Values, digits: int = 2) -> str:
    """``mean ± sample standard deviation``; a dash for nothing."""
    if not len(values):
        return NOTHING
    sigma = float(np.std(values, ddof=1)) if len(values) > 1 else 0.0
    return f"{float(np.mean(values)):.{digits}f} ± {sigma:.{digits}f}"


def median(values: Values, digits: int = 2) -> str:
    """The median; a dash for nothing."""
    return percentile(values, 50.0, digits)


def percentile(values: Values, percent: float, digits: int = 2) -> str:
    """A percentile; a dash for nothing."""
    return f"{float(np.percentile(values, percent)):.{digits}f}" if len(values) else NOTHING


def share(part: int, whole: int) -> str:
    """``part of whole (95 % interval)``, Clopper-Pearson."""
    if whole == 0:
        return NOTHING
    interval = binomtest(part, whole).proportion_ci(0.95)
    return f"{part} of {whole} ({100 * interval.low:.0f}–{100 * interval.high:.0f} %)"


def paired(a: Values, b: Values) -> tuple[float, int, float]:
    """Of pairs (a, b): median of a / b, how many a are smaller, and Wilcoxon's two-sided p that neither tends to be; p = 1 without data."""
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if not len(first):
        return float("nan"), 0, 1.0
    p = 1.0 if np.allclose(first, second) else float(wilcoxon(first, second).pvalue)
    return float(np.median(first / second)), int(np.sum(first < second)), p


def mcnemar(before: Sequence[bool], after: Sequence[bool]) -> float:
    """McNemar's exact two-sided p that of paired yes and no as many changed one way as the other."""
    gained = sum(b and not a for a, b in zip(before, after, strict=True))
    lost = sum(a and not b for a, b in zip(before, after, strict=True))
    return float(binomtest(gained, gained + lost).pvalue) if gained + lost else 1.0


def sign_word(p: float) -> str:
    """A p value in words."""
    return f"p = {p:.2g} (Wilcoxon)"
