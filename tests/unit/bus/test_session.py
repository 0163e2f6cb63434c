"""The bus against a real router: newest-only, lossless, late joiners, commands, error replies, liveliness, bad payloads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from clients.stack import free_endpoint
from common.bus.channels import COMMAND_QUEUE_LENGTH, Commands
from common.bus.session import Bus, BusAddress, RemoteError, Router
from common.errors import RequestError
from common.wire.messages import Ack, CancelGoal, Empty, GoalAccepted, PlannerEvent, RobotState, SetGoal
from tests.support.eventually import eventually

Join = Callable[[], Bus]


def state(time_s: float) -> RobotState:
    zeros = np.zeros(6)
    return RobotState(
        q_rad=zeros,
        dq_rad_s=zeros,
        q_reference_rad=zeros,
        mode="idle",
        reason="",
        trajectory_id="",
        trajectory_time_s=time_s,
        trajectory_accepted_ns=0,
    )


def event(number: int) -> PlannerEvent:
    return PlannerEvent(number=number, kind="replanned", facts={})


@contextmanager
def serving(bus: Bus, serve: Callable[[], None]) -> Iterator[None]:
    """Calls ``serve`` whenever the bus wakes, as the service loop does."""
    over = threading.Event()

    def loop() -> None:
        while not over.is_set():
            bus.wake.wait(0.05)
            bus.wake.clear()
            serve()

    thread = threading.Thread(target=loop)
    thread.start()
    try:
        yield
    finally:
        over.set()
        bus.wake.set()
        thread.join()


def test_a_newest_only_inbox_keeps_the_newest(join: Join) -> None:
    reader, writer = join(), join()
    inbox = reader.latest("robot/state", RobotState)
    publisher = writer.publisher("robot/state", RobotState)
    eventually(lambda: publisher.publish(state(-1.0)) and inbox.take(), what="the subscription")
    for n in range(50):
        publisher.publish(state(float(n)))
    last = []

    def newest_is_here() -> bool:
        publisher.publish(state(49.0))  # a state comes again and again: a burst may lose any one of its samples, also the last
        last.extend(inbox.take_all())
        return bool(last) and last[-1].message.trajectory_time_s == 49.0

    eventually(newest_is_here, what="the fiftieth sample")
    assert [r.message.seq for r in last] == sorted({r.message.seq for r in last})


def test_a_wildcard_inbox_keeps_the_newest_of_each_key(join: Join) -> None:
    reader, writer = join(), join()
    inbox = reader.latest("*/event", PlannerEvent)
    publisher = writer.publisher("planner/event", PlannerEvent)
    eventually(lambda: publisher.publish(event(1)) and inbox.take(), what="the subscription")
    publisher.publish(event(2))
    received: list[tuple[str, int]] = []

    def second_is_here() -> bool:  # the first may still be on its way: it was published until one of it had come
        received.extend((r.key, r.message.number) for r in inbox.take_all())
        return bool(received) and received[-1] == ("planner/event", 2)

    eventually(second_is_here, what="the second event")
    assert {key for key, _ in received} == {"planner/event"}


def test_a_queue_keeps_every_sample_in_order(join: Join) -> None:
    reader, writer = join(), join()
    inbox = reader.queue("planner/event", PlannerEvent)
    publisher = writer.publisher("planner/event", PlannerEvent)
    eventually(lambda: publisher.publish(event(0)) and inbox.take_all(), what="the subscription")
    for n in range(1, 201):
        publisher.publish(event(n))
    numbers: list[int] = []

    def all_are_here() -> bool:
        numbers.extend(r.message.number for r in inbox.take_all() if r.message.number > 0)
        return len(numbers) >= 200

    eventually(all_are_here, what="two hundred events")
    assert numbers == list(range(1, 201))


def test_the_publisher_fills_the_header(join: Join) -> None:
    bus = join()
    publisher = bus.publisher("robot/state", RobotState)
    first, second = publisher.publish(state(0.0)), publisher.publish(state(0.0), stamp_ns=17)
    assert (first.seq, second.seq) == (1, 2)
    assert first.epoch == second.epoch == bus.epoch
    assert second.stamp_ns == 17
    assert first.stamp_ns >= bus.epoch


def test_late_joiners_get_what_was_sent_last(join: Join) -> None:
    writer = join()
    publisher = writer.publisher("planner/event", PlannerEvent, history=3)
    for n in range(5):
        publisher.publish(event(n))
    with serving(writer, writer.answer_gets):
        late = join()
        answers = eventually(lambda: late.get_state("planner/event", PlannerEvent), what="answers to get")
    assert [answer.number for answer in answers] == [2, 3, 4]


def test_a_command_is_answered(join: Join) -> None:
    server, client = join(), join()
    goals: Commands[SetGoal] = server.commands("planner/goal", SetGoal)

    def serve() -> None:
        for command in goals.take_all():
            command.reply(GoalAccepted(goal_id=f"to {command.request.name}"))

    with serving(server, serve):
        reply = client.request("planner/goal", SetGoal(name="home"), GoalAccepted)
    assert reply.goal_id == "to home"


def test_an_error_reply_carries_code_message_and_facts(join: Join) -> None:
    server, client = join(), join()
    goals = server.commands("planner/goal", SetGoal)

    def serve() -> None:
        for command in goals.take_all():
            command.fail(RequestError("joint 2 is out of limits", code="out_of_limits", facts={"joint": 2}))

    with serving(server, serve), pytest.raises(RemoteError, match="joint 2") as caught:
        client.request("planner/goal", SetGoal(name="home"), GoalAccepted)
    assert caught.value.code == "out_of_limits"
    assert caught.value.facts == {"joint": 2}


def test_nobody_there_is_an_error_not_a_hang(join: Join) -> None:
    with pytest.raises(RemoteError) as caught:
        join().request("planner/goal", SetGoal(name="home"), GoalAccepted, timeout_s=0.3)
    assert caught.value.code == "no_answer"


def answered(client: Bus) -> bool:
    return any(answer.ok is not None for answer in client.session.get("planner/cancel", timeout=2.0))


def test_a_bad_command_is_answered_with_an_error_and_counted(join: Join) -> None:
    server, client = join(), join()
    goals = server.commands("planner/goal", SetGoal)
    with serving(server, lambda: [command.reply(Ack()) for command in goals.take_all()] and None):
        errors = eventually(
            lambda: [answer.err for answer in client.session.get("planner/goal", payload=b"\xc1garbage", timeout=2.0)], what="an answer"
        )
        eventually(lambda: client.request("planner/goal", SetGoal(name="home"), Ack), what="a good command after the bad one")
    assert errors[0] is not None
    assert b"bad_payload" in bytes(errors[0].payload)
    assert server.counters["bad_payloads"] == 1


def test_a_command_without_payload_is_an_empty_map(join: Join) -> None:
    server, client = join(), join()
    stops = server.commands("robot/stop", Empty)
    with serving(server, lambda: [command.reply(Ack()) for command in stops.take_all()] and None):
        answers = eventually(lambda: [answer.ok for answer in client.session.get("robot/stop", timeout=2.0)], what="an answer")
    assert answers[0] is not None


def test_too_many_commands_are_refused_not_forgotten(join: Join) -> None:
    server, client = join(), join()
    goals = server.commands("planner/cancel", CancelGoal)
    # A query sent before the router has told the client of the queryable reaches nobody.
    with serving(server, lambda: [command.reply(Ack()) for command in goals.take_all()] and None):
        eventually(lambda: answered(client), what="the queryable to be known to the client")
    n = COMMAND_QUEUE_LENGTH + 5
    waiting = [client.session.get("planner/cancel", timeout=5.0) for _ in range(n)]
    eventually(lambda: len(goals._raw) == n, what="all commands to arrive")
    for command in goals.take_all():
        command.reply(Ack())
    answers = [answer for replies in waiting for answer in replies]
    assert sum(answer.ok is not None for answer in answers) == COMMAND_QUEUE_LENGTH
    assert sum(answer.err is not None and b"busy" in bytes(answer.err.payload) for answer in answers) == 5


def test_bad_state_is_dropped_and_counted(join: Join) -> None:
    reader, writer = join(), join()
    inbox = reader.latest("robot/state", RobotState)
    raw = writer.session.declare_publisher("robot/state")

    def bad_one_is_counted() -> bool:
        raw.put(b"\xff not a message")
        assert inbox.take() is None
        return reader.counters.get("bad_payloads", 0) > 0

    eventually(bad_one_is_counted, what="the complaint")
    publisher = writer.publisher("robot/state", RobotState)
    assert eventually(lambda: publisher.publish(state(3.0)) and inbox.take(), what="a good sample after it")


def test_liveliness_comes_and_goes(join: Join) -> None:
    watcher = join()
    seen: dict[str, bool] = {}
    watcher.watch_alive(seen.__setitem__)
    service = join()
    service.declare_alive("planner")
    eventually(lambda: seen.get("planner") is True, what="the token")
    eventually(lambda: watcher.alive_owners() == ["planner"], what="the token, asked for")
    service.close()
    eventually(lambda: seen.get("planner") is False, what="the end of the token")
    assert watcher.alive_owners() == []


def test_liveliness_is_told_to_late_watchers(join: Join) -> None:
    join().declare_alive("robot")
    seen: dict[str, bool] = {}
    join().watch_alive(seen.__setitem__)
    eventually(lambda: seen.get("robot") is True, what="the token that was there before")


def test_namespaces_are_worlds_of_their_own(endpoint: str) -> None:
    with Bus(BusAddress(endpoint, "left")) as left, Bus(BusAddress(endpoint, "right")) as right:
        left_inbox, right_inbox = left.latest("robot/state", RobotState), right.latest("robot/state", RobotState)
        publisher = left.publisher("robot/state", RobotState)
        eventually(lambda: publisher.publish(state(0.0)) and left_inbox.take(), what="the sample on its own side")
        assert right_inbox.take() is None


def test_without_a_router_there_is_an_error_in_time() -> None:
    with pytest.raises(RemoteError) as caught:
        Bus(BusAddress(free_endpoint()), connect_timeout_s=0.2)
    assert caught.value.code == "no_router"


def test_two_routers_cannot_share_a_port(endpoint: str) -> None:
    with pytest.raises(RemoteError) as caught:
        Router(endpoint)
    assert caught.value.code == "router"
