"""``tolman bench NAME``: run one of the measurements in benchmarks/."""

from __future__ import annotations

import argparse
import importlib
import pkgutil

import benchmarks
from common.errors import RequestError

__all__ = ["add_arguments", "run"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Name of the measurement; the rest of the line is its own."""
    parser.add_argument("name", nargs="?", help="without one: list them")
    parser.add_argument("rest", nargs=argparse.REMAINDER, help="arguments of the measurement; --help says which")


def measurements() -> list[str]:
    """Modules of ``benchmarks`` that can be run: those named ``bench_*``."""
    return sorted(info.name.removeprefix("bench_") for info in pkgutil.iter_modules(benchmarks.__path__) if info.name.startswith("bench_"))


def run(args: argparse.Namespace) -> int:
    """Give the rest of the line to ``benchmarks.bench_<name>``."""
    if args.name is None:
        print("\n".join(measurements()))
        return 0
    if args.name not in measurements():
        raise RequestError(f"{args.name!r} is no measurement; there are: {', '.join(measurements())}", code="unknown_benchmark")
    module = importlib.import_module(f"benchmarks.bench_{args.name}")
    parser = argparse.ArgumentParser(prog=f"tolman bench {args.name}", description=(module.__doc__ or "").partition("\n")[0])
    module.add_arguments(parser)
    return int(module.run(parser.parse_args(args.rest)))
