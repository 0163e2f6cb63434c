"""``tolman paper``: repeat the paper's experiments and write the report that sets them beside ours."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from benchmarks.paper.registry import GROUPS, NAMES, PARTS, resolve
from clients.cli.options import add_cell_arguments
from common import cell
from services.planner.config import PlannerConfig

__all__ = ["add_arguments", "run"]

TELL_EVERY_S = 5.0  # our choice: where there is no terminal, a line now and then


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which parts, how large, where the report goes."""
    parser.add_argument("parts", nargs="*", metavar="PART", help="names of parts or groups (tables, figures, claims); default: all")
    parser.add_argument("--out", type=Path, default=Path("report"), metavar="DIR", help="folder of the report (default: %(default)s/)")
    parser.add_argument("--quick", action="store_true", help="small maps and few runs: every part in under 3 minutes, no figure means much")
    parser.add_argument("--seed", type=int, default=0, help="of scenes and sampling planners (default: %(default)s)")
    parser.add_argument(
        "--only",
        default="",
        metavar="TEXT",
        help="of table1 and table2 only rows with this in their name (gng-astar-raw-checked, ompl_prm): printed, not put into the report",
    )
    parser.add_argument("--dodge", type=Path, metavar="FILE", help="draw this recorded dodge instead of running the stack")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="also write a copy without raw results there: report.md and PNGs")
    parser.add_argument("--list", action="store_true", help="list the parts and end")
    add_cell_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """0: the parts are measured and the report is written."""
    names = resolve(args.parts)
    if args.list:
        print(_listed())
        return 0
    from benchmarks.paper.report.markdown import section_markdown  # noqa: PLC0415
    from benchmarks.paper.report.write import keep_copy, write_report  # noqa: PLC0415  matplotlib and the planner's kernels take seconds to load
    from benchmarks.paper.run import run_parts  # noqa: PLC0415
    from benchmarks.paper.scale import FULL, QUICK  # noqa: PLC0415
    from benchmarks.paper.study import StackOf, Study  # noqa: PLC0415

    scale = QUICK if args.quick else FULL
    overrides = [*scale.overrides, *args.set]
    shared, config = cell.load(args.config, "planner", PlannerConfig, overrides)
    study = Study(shared, config, scale, args.seed, only=args.only, stack=StackOf(args.config, tuple(overrides), args.dodge))
    began_s = time.monotonic()
    for k, name in enumerate(names):
        part_s = time.monotonic()
        with _progress(f"[{k + 1}/{len(names)}] {name}") as study.tell:
            sections = run_parts(study, [name], args.out)
        print(f"[{k + 1}/{len(names)}] {name}: done in {time.monotonic() - part_s:.0f} s", file=sys.stderr, flush=True)
        if args.only:
            print("\n".join(section_markdown(section) for section in sections))
            continue
        write_report(args.out, NAMES)
    if args.only:
        return 0
    paths = write_report(args.out, NAMES)
    if args.keep is not None:
        paths.append(keep_copy(args.out, NAMES, args.keep))
    print(f"{' '.join(str(path) for path in paths)} after {time.monotonic() - began_s:.0f} s")
    return 0


def _listed() -> str:
    lines = [f"{', '.join(GROUPS)}: groups", *(f"  {name:<18}{PARTS[name].title}" for name in NAMES)]
    return "\n".join(lines)


@contextmanager
def _progress(head: str) -> Iterator[Callable[[str, float | None], None]]:
    """What is done now: one line that changes on a terminal, else a line every few seconds."""
    console = Console(stderr=True)
    told_s = 0.0
    with console.status(head) as status:

        def tell(what: str, share: float | None) -> None:
            nonlocal told_s
            text = f"{head}: {what}" + ("" if share is None else f" {100.0 * share:.0f} %")
            status.update(text.replace("[", "\\["))
            if not console.is_terminal and time.monotonic() - told_s > TELL_EVERY_S:
                told_s = time.monotonic()
                print(text, file=sys.stderr, flush=True)

        yield tell
