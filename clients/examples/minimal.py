"""All that a client needs: zenoh, msgpack and numpy. Adds a box, asks for a plan, sends a goal, reads where the arm is.

``python clients/examples/minimal.py [ENDPOINT [NAMESPACE]]``, with a stack running (``tolman up``).
"""

import json
import sys
import time
from typing import Any

import msgpack
import numpy as np
import zenoh

ENDPOINT = sys.argv[1] if len(sys.argv) > 1 else "tcp/127.0.0.1:7447"
NAMESPACE = sys.argv[2] if len(sys.argv) > 2 else "tolman"


def ask(session: zenoh.Session, key: str, **fields: Any) -> Any:
    """Send a command and return its reply; docs/protocol.md lists keys and fields."""
    for answer in session.get(key, payload=msgpack.packb(fields), timeout=10.0):
        if answer.ok:
            return msgpack.unpackb(bytes(answer.ok.payload))
        raise RuntimeError(f"{key}: {bytes(answer.err.payload) if answer.err else ''!r}")
    raise RuntimeError(f"{key}: nobody answered")


def array(field: dict[str, Any]) -> Any:
    """The numpy array of a wire array."""
    return np.frombuffer(field["data"], dtype=field["dtype"]).reshape(field["shape"])


config = zenoh.Config()
for name, value in (("mode", "client"), ("connect/endpoints", [ENDPOINT]), ("namespace", NAMESPACE), ("scouting/multicast/enabled", False)):
    config.insert_json5(name, json.dumps(value))

with zenoh.open(config) as session:
    ask(session, "robot/obstacle", op="add", id="example", shape="box", size_m=[0.1, 0.1, 0.1], position_m=[0.4, 0.0, 0.45])
    goal = {"pose": {"position_m": [0.32, 0.3, 0.2], "quaternion_xyzw": [1.0, 0.0, 0.0, 0.0]}}
    plan = ask(session, "planner/plan", goal=goal)
    print(f"plan: {plan['outcome']}, {plan['length_rad']:.2f} rad, path of shape {array(plan['path_q_rad']).shape}")

    events = session.declare_subscriber("planner/event", zenoh.handlers.FifoChannel(64))
    goal_id = ask(session, "planner/goal", **goal)["goal_id"]
    deadline = time.monotonic() + 60.0
    is_over = False
    while not is_over and time.monotonic() < deadline:
        while (sample := events.try_recv()) is not None:
            event = msgpack.unpackb(bytes(sample.payload))
            is_over = is_over or (event["goal_id"] == goal_id and event["kind"] == "goal_reached")
        time.sleep(0.01)
    state = ask(session, "robot/state")
    print(f"goal reached: {is_over}; the arm is {state['mode']} at", np.round(array(state["q_rad"]), 3).tolist())
    ask(session, "robot/obstacle", op="remove", id="example")
sys.exit(0 if is_over else 1)
