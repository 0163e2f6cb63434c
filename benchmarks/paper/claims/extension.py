"""Claim: a gas trained on general motions is extended by a task's instead of being trained anew."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.paper.ask import Variant, answer
from benchmarks.paper.maps import KeptMap, kept_map
from benchmarks.paper.outcome import HOLDS, IN_PART, NOT, NOT_AT_HAND, UNDECIDED, Holds, Outcome, Table, Verdict
from benchmarks.paper.stats import mcnemar, share
from benchmarks.paper.study import Study
from benchmarks.questions import Question
from services.planner.core.cognitive_map import CognitiveMap, quantisation_error_rad
from services.planner.core.gng import GrowingNeuralGas
from services.planner.core.rrt_connect import RrtParameters
from services.planner.offline.growth import gas_parameters
from services.planner.offline.motions import resample
from services.planner.offline.scene import Scene

__all__ = ["Learned", "measure", "verdict_on"]

F64 = NDArray[np.float64]
STREAM = 97  # of the generator, so that other parts draw other numbers
SAMPLES_A_NEURON = 5  # as for the shipped map: 50 000 samples for 10 000 neurons
GENERAL_SHARE = 6  # neurons for each general motion; our choice, as many samples a motion as the task has
ATTEMPTS = 50
BY_CHANCE, FEWEST = 0.05, 10  # a p below is no chance; fewer questions decide nothing
INTRO = (
    "General motions: RRTConnect between random free joint vectors, without obstacles. Task motions: those of the shipped map, from bin "
    "to bin. A gas of {n} neurons learns the general ones; *extended*: it then sees the task's motions and grows by {n} neurons; *from "
    "scratch*: a gas of {both} neurons learns both at once, or {both} the task alone. Old task: {q} questions of the set “off_task”; new "
    "task: {q} of the set “task”; by our rules. The seconds of *extended* are those of the extension: the map was there. SOM and γ-SOM "
    "cannot be extended: their lattice has a fixed size, and `partial_fit` and `tolman build --extend` say so."
)


@dataclass(frozen=True)
class Learned:
    """One map: seconds of training, quantisation errors in rad, and which questions of either task it solves."""

    name: str
    n_neurons: int
    training_s: float
    general_error_rad: float
    task_error_rad: float
    old: tuple[bool, ...]
    new: tuple[bool, ...]

    @property
    def n_old(self) -> int:
        """Questions of the old task that it solves."""
        return sum(self.old)

    @property
    def n_new(self) -> int:
        """Questions of the new task that it solves."""
        return sum(self.new)

    @property
    def n_asked(self) -> int:
        """Questions of each task."""
        return len(self.old)


def measure(study: Study) -> Outcome:
    """Base, extended, and both ways from scratch."""
    n, m = study.scale.extend_neurons, study.scale.n_extend_scenes
    general, task = _general_samples(study), study.samples.q_rad
    both = np.vstack([general, task])
    base = _made(study, "general", [n], lambda: _fit(study, general, n))
    maps = {
        "general only": base,
        "extended by the task": _made(study, "extended", [n], lambda: _extend(study, base[0], task, 2 * n)),
        "from scratch, both": _made(study, "scratch-both", [2 * n], lambda: _fit(study, both, 2 * n)),
        "from scratch, task only": _made(study, "scratch-task", [2 * n], lambda: _fit(study, task, 2 * n)),
    }
    old, new = study.scenes(m, "off_task"), study.scenes(m)
    learned = [
        Learned(
            name,
            n_neurons=kept.learned.n_neurons,
            training_s=training_s,
            general_error_rad=quantisation_error_rad(kept.learned, general),
            task_error_rad=quantisation_error_rad(kept.learned, task),
            old=_solved(study, kept, old, name),
            new=_solved(study, kept, new, name),
        )
        for name, (kept, training_s) in maps.items()
    ]
    return Outcome(
        INTRO.format(n=n, both=2 * n, q=m),
        rows=[{"row": k.name, **msgspec.to_builtins(k), "n_old": k.n_old, "n_new": k.n_new} for k in learned],
        tables=[_table(learned)],
        verdicts=[verdict_on(learned)],
        data=learned,
    )


def _table(learned: Sequence[Learned]) -> Table:
    columns = (
        "map",
        "neurons",
        "training, s",
        "error on general motions, rad",
        "error on the task, rad",
        "old task solved",
        "new task solved",
    )
    note = (
        "Training: seconds of learning alone, without motions and table, in this run. Error: mean distance of samples to their best match."
    )
    rows = []
    for k in learned:
        errors = [f"{error_rad:.3f}" for error_rad in (k.general_error_rad, k.task_error_rad)]
        solved = [share(n, k.n_asked) for n in (k.n_old, k.n_new)]
        rows.append([k.name, str(k.n_neurons), f"{k.training_s:.1f}", *errors, *solved])
    return Table("Extended and from scratch", columns, rows, note)


def _general_samples(study: Study) -> F64:
    n = study.scale.extend_neurons
    scene = study.job.scene
    paths = (
        _general_motion(scene, np.random.SeedSequence(study.config.motions.seed, spawn_key=(STREAM, k))) for k in range(n // GENERAL_SHARE)
    )
    found = study.once("general motions", lambda: list(study.shown(paths, "general motions", n // GENERAL_SHARE)))
    return resample([path for path in found if path is not None], SAMPLES_A_NEURON * n).q_rad


def _general_motion(scene: Scene, sequence: np.random.SeedSequence) -> F64 | None:
    """A motion between two random free joint vectors; None if none was found."""
    rng, state = np.random.default_rng(sequence), sequence.spawn(1)[0].generate_state(4, np.uint64).astype(np.uint64)
    planner = scene.planner(RrtParameters(shortcuts=10))
    world = scene.world(planner, np.empty(0, dtype=np.int32))
    low, high = scene.robot.position_min_rad, scene.robot.position_max_rad
    for _ in range(ATTEMPTS):
        path = planner.plan(world, rng.uniform(low, high), rng.uniform(low, high), state)
        if path is not None:
            return planner.simplify(world, path, state)
    return None


def _fit(study: Study, samples: F64, n_neurons: int) -> CognitiveMap:
    gas = GrowingNeuralGas(gas_parameters(study.config.map), n_neurons)
    starts = np.zeros(1, dtype=np.int64)  # a gas has no memory
    return gas.fit(samples, starts, study.config.map.seed, lambda done: study.tell("gas", done)).to_map()


def _extend(study: Study, base: KeptMap, samples: F64, n_neurons: int) -> CognitiveMap:
    """The base shown the task's samples, until it has grown; a gas inserts once in so many signals, a quarter more for those that die."""
    config = study.config
    gas = GrowingNeuralGas.of_map(base.learned, gas_parameters(config.map), n_neurons, samples)
    n_signals = max(config.extend.rounds * len(samples), config.map.insert_every * (n_neurons - base.learned.n_neurons) * 5 // 4)
    return gas.partial_fit(samples, config.extend.seed, n_signals).to_map()


def _made(study: Study, name: str, inputs: list[int], learn: Callable[[], CognitiveMap]) -> tuple[KeptMap, float]:
    """A map, and the seconds of its learning: learned anew each time, as the seconds are the claim; its table may be kept."""
    began_s = time.monotonic()
    learned = learn()
    training_s = time.monotonic() - began_s
    inputs = [STREAM, *inputs, study.config.map.seed, len(study.samples.q_rad)]
    return kept_map(study.job, name, inputs, lambda: learned, study.tell), training_s


def _solved(study: Study, kept: KeptMap, questions: Sequence[Question], name: str) -> tuple[bool, ...]:
    parts = study.on(kept.roadmap("gng"))
    planner, variant = parts.motion_planner(), Variant("gng", "dijkstra", True, "checked")
    return tuple(answer(parts, planner, question, variant).solved for question in study.shown(questions, name, len(questions)))


def verdict_on(learned: Sequence[Learned]) -> Verdict:
    """Faster than anew, nothing of the old task lost beyond chance, more of the new one solved beyond chance."""
    by = {k.name: k for k in learned}
    base, extended, scratch = by["general only"], by["extended by the task"], by["from scratch, both"]
    lost, gained = mcnemar(base.old, extended.old), mcnemar(base.new, extended.new)
    good = [
        extended.training_s < scratch.training_s,
        extended.n_old >= base.n_old or lost >= BY_CHANCE,
        extended.n_new > base.n_new and gained < BY_CHANCE,
    ]
    holds: Holds = UNDECIDED if extended.n_asked < FEWEST else HOLDS if all(good) else IN_PART if any(good) else NOT
    said = (
        f"training {extended.training_s:.1f} s against {scratch.training_s:.1f} s from scratch; old task solved {base.n_old} -> "
        f"{extended.n_old} (p = {lost:.2g}), new task {base.n_new} -> {extended.n_new} (p = {gained:.2g}), of {base.n_asked}"
    )
    three = (base, extended, scratch)
    task, general = ([f"{getattr(k, what):.3f} rad" for k in three] for what in ("task_error_rad", "general_error_rad"))
    details = [
        f"error on the task: {task[0]} before, {task[1]} extended, {task[2]} from scratch",
        f"error on the general motions: {general[0]} before, {general[1]} extended, {general[2]} from scratch",
        f"old task: {base.n_old} of {base.n_asked} before, {extended.n_old} extended, {scratch.n_old} from scratch",
        f"new task: {base.n_new} of {base.n_asked} before, {extended.n_new} extended, {scratch.n_new} from scratch",
    ]
    word = (
        "*Holds* means: faster than training anew on both, nothing of the old task lost beyond chance, and more of the new one solved "
        "beyond chance (McNemar's exact test on the same questions)."
    )
    return Verdict("A gas can be extended by a new task", NOT_AT_HAND, said, holds, word, details)
