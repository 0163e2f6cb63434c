"""Peers by name; OMPL and roboplan are imported only when one of theirs is asked for."""

from __future__ import annotations

import importlib

from benchmarks.peers.peer import Peer, Setting
from common.errors import RequestError

__all__ = ["PEERS", "make_peer"]

OMPL, ROBOPLAN = "benchmarks.peers.ompl_peers", "benchmarks.peers.roboplan_peer"
MODULES = {
    "ompl_rrt_connect": OMPL,
    "ompl_rrt": OMPL,
    "ompl_prm": OMPL,
    "ompl_bit_star": OMPL,
    "roboplan_rrt_connect": ROBOPLAN,
}
PEERS = tuple(MODULES)


def make_peer(name: str, setting: Setting) -> Peer:
    """The peer called ``name``.

    Raises:
        RequestError: no such peer, or its library is not installed.
    """
    if name not in MODULES:
        raise RequestError(f"no peer is called {name!r}; there are: {', '.join(PEERS)}", code="unknown_peer")
    try:
        module = importlib.import_module(MODULES[name])
    except ImportError as error:
        raise RequestError(f"peer {name}: {error}; it comes with the extra [bench]", code="peer_missing") from error
    peer: Peer = module.make(name, setting)
    return peer
