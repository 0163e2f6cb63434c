"""What leaf kernels promise (``common.kernel``): whoever breaks it would lose arrays, or count none."""

from __future__ import annotations

import ast
import importlib
import pkgutil
from pathlib import Path

import numpy as np
import pytest
from numba.core.caching import NullCache
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

import common
import services
from common.kernel import copy_row, kernel, leaf
from tests.support.repository import ROOT

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


def test_only_leaves_call_what_is_inlined():
    """Compiled into a kernel that counts it would count as well, and be slow."""
    kernels = _kernels().values()
    inlined = [d for d in kernels if _is_leaf(d) and d.targetoptions.get("inline") == "always"]
    assert len(inlined) > 0
    assert [d.__name__ for d in kernels if not _is_leaf(d) and any(called in inlined for called in _called(d))] == []


# Of numbers, not of arrays. Whether what creates an array (`a.sort()` does) compiles in a leaf depends on what was compiled before.
OF_NUMBERS = {"np.exp", "np.float32", "np.floor", "np.int64", "np.isnan", "np.rint", "np.sqrt", "np.uint16", "np.uint64", "np.uint8"}


def _methods_called(source: Path) -> dict[str, set[str]]:
    """Of each leaf in a file what it calls by a dotted name, but for ``math``."""
    tree = ast.parse(source.read_text(encoding="utf-8"))
    leaves = [n for n in tree.body if isinstance(n, ast.FunctionDef) and {"leaf", "inlined"} & {ast.unparse(d) for d in n.decorator_list}]
    calls = {n.name: [c.func for c in ast.walk(n) if isinstance(c, ast.Call) and isinstance(c.func, ast.Attribute)] for n in leaves}
    return {name: {ast.unparse(f) for f in called if ast.unparse(f.value) != "math"} for name, called in calls.items()}


def test_leaves_call_nothing_that_may_create_an_array():
    found = [_methods_called(source) for package in ("common", "services") for source in sorted((ROOT / package).rglob("*.py"))]
    called = {name: methods for of_file in found for name, methods in of_file.items()}
    assert len(called) > 100
    assert {name: methods - OF_NUMBERS for name, methods in called.items() if methods - OF_NUMBERS} == {}


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
