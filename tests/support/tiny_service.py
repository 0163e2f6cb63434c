"""A real process for the supervisor's tests: joins the bus, says that it is alive, and behaves as its arguments ask.

``python -m tests.support.tiny_service OWNER [--deaf] [--refuse] [--crash-after-ready]`` with the options of every service.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading

from common.bus.service import add_bus_arguments
from common.bus.session import Bus, BusAddress


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("owner")
    parser.add_argument("--deaf", action="store_true", help="ignore INT")
    parser.add_argument("--refuse", action="store_true", help="say why and return 2")
    parser.add_argument("--crash-after-ready", action="store_true")
    parser.add_argument("--log-level")
    add_bus_arguments(parser)
    args = parser.parse_args()
    over = threading.Event()
    signal.signal(signal.SIGINT, signal.SIG_IGN if args.deaf else lambda *_: over.set())
    print(f"{args.owner} begins", file=sys.stderr, flush=True)
    if args.refuse:
        print("config: no such thing", file=sys.stderr)
        return 2
    with Bus(BusAddress(args.connect, args.namespace)) as bus:
        bus.declare_alive(args.owner)
        if args.crash_after_ready:
            over.wait(0.3)
            os.kill(os.getpid(), signal.SIGKILL)
        while not over.wait(0.05):
            pass
    return 0


if __name__ == "__main__":
    sys.exit(main())
