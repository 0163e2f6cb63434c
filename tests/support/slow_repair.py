"""The search by two trees in words: nodes are objects, the map is looked at edge by edge."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, field

import numpy as np

from services.planner.core.check import Checker
from services.planner.core.roadmap import Roadmap
from services.planner.kernels import repair as kernel
from services.planner.kernels.cells import Cells
from services.planner.kernels.collision import FREE
from services.planner.kernels.path import segment_verdict
from tests.support.slow_xoshiro import SlowXoshiro

__all__ = ["SlowTwoTrees"]


@dataclass(eq=False)
class Node:
    q: np.ndarray
    parent: Node | None
    neuron: int = -1


@dataclass(eq=False)
class SlowTwoTrees:
    """Arguments as for the kernel; ``step_m`` is that of its checks. No counts: nothing of the map is known."""

    checker: Checker
    cells: Cells
    step_m: float
    roadmap: Roadmap
    node_count: np.ndarray
    edge_count: np.ndarray
    q_min: np.ndarray
    q_max: np.ndarray
    rng: SlowXoshiro
    trees: tuple[list[Node], list[Node]] = field(default_factory=lambda: ([], []))
    tree_of: dict[int, int] = field(default_factory=dict)
    cost: dict[int, float] = field(default_factory=dict)
    node_of: dict[int, Node] = field(default_factory=dict)
    iterations: int = 0

    def solve(self, q_start: np.ndarray, q_goals: np.ndarray, n_connections: int, max_iterations: int) -> np.ndarray | None:
        joint = self._plant(q_start, q_goals, n_connections)
        while joint is None and self.iterations < max_iterations:
            joint = self._iterate(self.iterations % 2)
            self.iterations += 1
        if joint is None:
            return None
        first, second = self._to_root(joint[0])[::-1], self._to_root(joint[1])
        return np.array(first[:-1] + second if np.array_equal(first[-1], second[0]) else first + second)

    def _plant(self, q_start, q_goals, n_connections):
        self.trees[0].append(Node(q_start, None))
        self.trees[1].extend(Node(q, None) for q in q_goals)
        order = [n for n in range(len(self.node_count)) if self.node_count[n] == 0]
        best = (np.inf, None)
        for side in (0, 1):
            for root in list(self.trees[side]):
                far = {n: self._far(root.q, self.roadmap.neurons_rad[n]) for n in order}
                for n in sorted(order, key=lambda n: (far[n], n))[:n_connections]:
                    if self.tree_of.get(n) == side or self._verdict(root.q, self.roadmap.neurons_rad[n])[0] != FREE:
                        continue
                    if self.tree_of.get(n) == 0:
                        best = min(best, (self.cost[n] + far[n], (self.node_of[n], root)), key=lambda b: b[0])
                        break
                    self._take_in(side, {n: (far[n], root)})
        return best[1]

    def _take_in(self, side, reached):
        """Dijkstra from neurons that are reached at a cost from a node."""
        best = dict(reached)
        heap = [(cost, n) for n, (cost, _) in best.items()]
        heapq.heapify(heap)
        while heap:
            cost, n = heapq.heappop(heap)
            if n in self.tree_of:
                continue
            node = Node(self.roadmap.neurons_rad[n], best[n][1], n)
            self.trees[side].append(node)
            self.tree_of[n], self.cost[n], self.node_of[n] = side, cost, node
            for edge, (a, b) in enumerate(self.roadmap.edges):
                m = {int(a): int(b), int(b): int(a)}.get(n)
                if m is None or self.edge_count[edge] or self.node_count[m] or m in self.tree_of:
                    continue
                through = cost + self._far(self.roadmap.neurons_rad[n], self.roadmap.neurons_rad[m])
                if m not in best or through < best[m][0]:
                    best[m] = (through, node)
                    heapq.heappush(heap, (through, m))

    def _iterate(self, side):
        mine, others = self.trees[side], self.trees[1 - side]
        q, neuron = self._sample(mine, others)
        reached, last = self._march(mine, self._nearest(mine, q), q, kernel.RANGE_RAD if neuron < 0 else np.inf)
        if reached and neuron >= 0:
            first = len(mine)
            self._take_in(side, {neuron: (0.0, last)})
            last = mine[first]
        elif reached:
            last = Node(q, last)
            mine.append(last)
        elif last is None:
            return None
        reached, at = self._march(others, self._nearest(others, last.q), last.q, np.inf)
        if not reached:
            return None
        return (last, at) if side == 0 else (at, last)

    def _sample(self, mine, others):
        kind = self.rng.uniform()
        blocked = [n for n in range(len(self.node_count)) if self.node_count[n] != 0]
        free = sorted(set(range(len(self.node_count))) - set(blocked))
        first, second, third, fourth = np.cumsum(kernel.SHARES if len(self.node_count) else kernel.SHARES_WITHOUT_MAP)
        if kind < first:
            for _ in range(kernel.NEURON_DRAWS if free else 0):
                n = free[int(self.rng.uniform() * len(free))]
                if n not in self.tree_of:
                    return self.roadmap.neurons_rad[n], n
        elif kind < second:
            other = others[int(self.rng.uniform() * len(others))].q
            share = self.rng.uniform()
            return self._about(other + share * (self._nearest(mine, other).q - other), kernel.BETWEEN_RAD), -1
        elif kind < third:
            return self._about(mine[int(self.rng.uniform() * len(mine))].q, kernel.NEAR_RAD), -1
        elif kind < fourth and blocked:
            return self._about(self.roadmap.neurons_rad[blocked[int(self.rng.uniform() * len(blocked))]], kernel.BLOCKED_RAD), -1
        return np.array([a + self.rng.uniform() * (b - a) for a, b in zip(self.q_min, self.q_max, strict=True)]), -1

    def _about(self, middle, most_rad):
        return np.clip([x + (2.0 * self.rng.uniform() - 1.0) * most_rad for x in middle], self.q_min, self.q_max)

    def _march(self, tree, origin, target, reach):
        """Steps of RANGE_RAD, each wholly free: (reached?, the last node: None if nothing was added and the target was not reached)."""
        last, walked = None, 0.0
        while True:
            begin = last or origin
            far = self._far(begin.q, target)
            if far == 0.0:
                return True, begin
            share = min(1.0, kernel.RANGE_RAD / far)
            end = begin.q + share * (target - begin.q)
            if self._verdict(begin.q, end)[0] != FREE:
                return False, last
            if share == 1.0:
                return True, begin
            last = Node(end, begin)
            tree.append(last)
            walked += kernel.RANGE_RAD
            if walked >= reach:
                return False, last

    def _verdict(self, q_a, q_b):
        c = self.checker
        return segment_verdict(c.arm, c.solids, self.cells, c.safety_m, self.step_m, q_a, q_b)

    @staticmethod
    def _far(a, b):
        return math.sqrt(sum((x - y) ** 2 for x, y in zip(a, b, strict=True)))

    def _nearest(self, tree, q):
        return min(tree, key=lambda node: self._far(node.q, q))

    @staticmethod
    def _to_root(node):
        points = []
        while node is not None:
            points.append(node.q)
            node = node.parent
        return points
