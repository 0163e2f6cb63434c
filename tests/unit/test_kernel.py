"""What leaf kernels promise (``common.kernel``): whoever breaks it would lose arrays, or count none."""

from __future__ import annotations

import importlib
import pkgutil

import numpy as np
import pytest
from numba.core.caching import NullCache
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

import common
import services
from common.kernel import copy_row, kernel, leaf

# Kernels that leaves call. Each of them returns numbers: look before another one is added.
LENT_TO_LEAVES = {"line_between_is_free", "nearest_free", "both_ends", "_insert", "_joins", "_fit_box", "_cube_meets_cylinder"}


def _kernels() -> dict[str, Dispatcher]:
    found = {}
    for package in (common, services):
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            if "kernel" in module.name or module.name.startswith("common.robot"):
                members = vars(importlib.import_module(module.name))
                found.update({f"{d.py_func.__module__}.{d.__name__}": d for d in members.values() if isinstance(d, Dispatcher)})
    return found


def _is_leaf(dispatcher: Dispatcher) -> bool:
    return dispatcher.targetoptions.get("_nrt") is False


def _called(dispatcher: Dispatcher) -> list[Dispatcher]:
    function = dispatcher.py_func
    return [d for name in function.__code__.co_names if isinstance(d := function.__globals__.get(name), Dispatcher)]


def test_leaves_call_only_leaves_and_kernels_that_return_no_array():
    leaves = [d for d in _kernels().values() if _is_leaf(d)]
    assert len(leaves) > 100
    for dispatcher in leaves:
        for called in _called(dispatcher):
            says_it_counts = called.targetoptions.get("_nrt") is True
            assert _is_leaf(called) or (says_it_counts and called.__name__ in LENT_TO_LEAVES), f"{dispatcher.__name__}: {called.__name__}"


def test_every_kernel_says_whether_it_counts():
    """But for two that divide by zero as numpy does; no leaf calls them."""
    silent = {name for name, d in _kernels().items() if "_nrt" not in d.targetoptions}
    assert silent == {"common.robot.rates.hermite_rates", "common.robot.rates._larger"}


def _not_from_disk(compiled):
    """What is kept on disk is known by source alone, and cannot be looked into."""
    compiled._cache = NullCache()
    return compiled


def _creates(a):
    return np.empty(3)[0] + a[0]


def _copies(a):
    return a.copy()[0]


def _adds(a):
    return (a + a)[0]


def _assigns(a):
    a[:] = a[::-1]


@pytest.mark.parametrize("function", [_creates, _copies, _adds, _assigns])
def test_a_leaf_creates_no_array(function):
    with pytest.raises(NumbaError):
        _not_from_disk(leaf(function))(np.ones(3))
    _not_from_disk(kernel(function))(np.ones(3))


def _sum(pair, k):
    return pair[0][k] + pair[1][k]


def test_a_leaf_counts_nothing():
    compiled = _not_from_disk(leaf(_sum))
    assert compiled((np.ones(4), np.ones(4)), 2) == 2.0
    assert "NRT_" not in next(iter(compiled.inspect_llvm().values()))


def test_a_row_is_copied():
    source, target = np.arange(3.0), np.zeros((2, 3))
    copy_row(source, target[1])
    assert target.tolist() == [[0.0, 0.0, 0.0], [0.0, 1.0, 2.0]]
