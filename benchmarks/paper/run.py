"""Runs parts of the report one after the other; each is kept as soon as it is measured."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.paper.canvas import style
from benchmarks.paper.experiment import Experiment
from benchmarks.paper.registry import experiment
from benchmarks.paper.report.section import Section, write_section
from benchmarks.paper.study import Study
from benchmarks.provenance import provenance

__all__ = ["run_parts"]

FIGURES = "figures"


def run_parts(study: Study, names: Sequence[str], out: Path) -> list[Section]:
    """Measure, draw and keep the parts called ``names``."""
    return [_run(study, experiment(name), out) for name in names]


def _run(study: Study, part: Experiment, out: Path) -> Section:
    began_s, load = time.monotonic(), _load()
    outcome = part.measure(study)
    seconds = time.monotonic() - began_s
    study.tell("drawing", None)
    with style():
        figures = part.draw(outcome, out / FIGURES) if part.draw is not None else []
    section = Section.of(
        part,
        outcome,
        figures,
        scale=study.scale.name,
        only=study.only,
        seconds=seconds,
        load=load + _load(),
        provenance=provenance(study.seed, study.plain_config),
    )
    write_section(section, out)
    return section


def _load() -> list[float]:
    """Load of the machine over the last minute, where it can be asked."""
    return [round(os.getloadavg()[0], 1)] if hasattr(os, "getloadavg") else []
