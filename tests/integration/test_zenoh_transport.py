"""Real zenoh sessions on loopback: every trap of the library stays closed."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh

from agents.launching.spawn import free_ports
from agents.messages.codec import KINDS, MAX_MESSAGE_BYTES
from agents.messages.keys import Keys
from agents.networks.transport import Arrival, Packet, Presence
from agents.networks.zenoh_transport import (
    LEASE_MS,
    QUEUE_BYTES,
    Endpoints,
    ZenohTransport,
    configuration,
    ring_size,
    stood_still,
)

pytestmark = pytest.mark.slow

CHILD = """
import sys, time
from agents.networks.zenoh_transport import Endpoints, ZenohTransport
ports = [int(p) for p in sys.argv[1].split(",")]
with ZenohTransport("t", 1, 7, Endpoints.mesh(ports, 1)) as transport:
    while True:
        transport.send("commit", b"from the child", reliable=True)
        {body}
        transport.receive(0.02)
"""


def endpoints(n: int = 2) -> list[Endpoints]:
    ports = free_ports(n)
    return [Endpoints.mesh(ports, head) for head in range(n)]


def until(transport: ZenohTransport, wanted: Arrival, within_s: float = 5.0) -> list[Arrival]:
    """Receive until `wanted` arrived; return all that came."""
    return until_all(transport, {wanted}, within_s)


def until_all(
    transport: ZenohTransport, wanted: set[Arrival], within_s: float = 5.0
) -> list[Arrival]:
    """Receive until all of `wanted` arrived; return all that came."""
    deadline, came = time.monotonic() + within_s, []
    while time.monotonic() < deadline:
        came += transport.receive(0.05)
        if wanted <= set(came):
            return came
    raise AssertionError(f"{wanted} did not arrive, but {came[-5:]}")


@contextmanager
def child(body: str = "pass") -> Iterator[tuple[ZenohTransport, subprocess.Popen[bytes]]]:
    """A transport here as head 0 and another process as head 1."""
    ports = free_ports(2)
    text = CHILD.format(body=body)
    process = subprocess.Popen([sys.executable, "-c", text, ",".join(map(str, ports))])
    try:
        with ZenohTransport("t", 0, 1, Endpoints.mesh(ports, 0)) as transport:
            until(transport, Presence(1, 7, True), 20.0)
            yield transport, process
    finally:
        process.kill()
        process.wait()


def test_the_configuration_closes_every_insecure_default() -> None:
    """zenoh listens on all interfaces, scouts, gossips and takes 1 GiB unless told not to."""
    config = configuration(Endpoints("tcp/127.0.0.1:7447", ("tcp/127.0.0.1:7448",)))

    def value(key: str) -> object:
        return json.loads(config.get_json(key))

    assert value("listen/endpoints") == ["tcp/127.0.0.1:7447"]
    assert value("connect/endpoints") == ["tcp/127.0.0.1:7448"]
    assert value("scouting/multicast/enabled") is False
    assert value("scouting/gossip/enabled") is False
    assert value("transport/shared_memory/enabled") is False
    assert value("transport/link/tx/lease") == LEASE_MS == 1000
    assert value("transport/link/rx/max_message_size") < 5 * 2**20
    assert value("transport/link/protocols") == ["tcp"]


def test_a_session_listens_on_loopback_only() -> None:
    """Another host must not reach an agent."""
    mine, _ = endpoints()
    port = int(mine.listen.rpartition(":")[2])
    with ZenohTransport("t", 0, 1, mine):
        rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        listening = [r[1] for r in rows if r[3] == "0A" and r[1].endswith(f":{port:04X}")]
    assert listening == [f"0100007F:{port:04X}"]


def test_three_peers_hear_each_other_in_a_full_mesh() -> None:
    """Peers do not relay: each needs a link to each."""
    a, b, c = endpoints(3)
    with (
        ZenohTransport("t", 0, 1, a) as first,
        ZenohTransport("t", 1, 1, b) as second,
        ZenohTransport("t", 2, 1, c) as third,
    ):
        for me, transport in enumerate((first, second, third)):
            until_all(transport, {Presence(h, 1, True) for h in range(3) if h != me})
        third.send("commit", b"x", reliable=True)
        third.send("distribution", b"y", reliable=False)
        for transport in (first, second):
            until_all(transport, {Packet(2, "commit", b"x"), Packet(2, "distribution", b"y")})


def test_sessions_of_other_names_do_not_mix() -> None:
    """Two prints planned on one host at once must not hear each other."""
    a, b = endpoints()
    with ZenohTransport("one", 0, 1, a) as first, ZenohTransport("two", 1, 1, b) as second:
        second.send("commit", b"x", reliable=True)
        assert first.receive(0.5) == []


def test_a_peer_that_starts_later_is_still_connected_to() -> None:
    """With a connect timeout of 0 zenoh tries once and never again."""
    a, b = endpoints()
    silent = Endpoints(b.listen, ())  # leaves the connecting to the other side
    with ZenohTransport("t", 0, 1, a) as first:
        assert first.receive(0.3) == []
        with ZenohTransport("t", 1, 1, silent):
            until(first, Presence(1, 1, True))


def test_a_closed_session_is_seen_to_leave() -> None:
    """The others re-assign its work at once."""
    a, b = endpoints()
    with ZenohTransport("t", 0, 1, a) as first:
        with ZenohTransport("t", 1, 3, b):
            until(first, Presence(1, 3, True))
        until(first, Presence(1, 3, False))


def test_an_oversized_message_is_dropped_and_the_link_lives_on() -> None:
    """One bad message must not cut a head off."""
    a, b = endpoints()
    with ZenohTransport("t", 0, 1, a) as first, ZenohTransport("t", 1, 1, b) as second:
        until(first, Presence(1, 1, True))
        second.send("commit", bytes(MAX_MESSAGE_BYTES + 10_000), reliable=True)
        second.send("commit", b"after", reliable=True)
        came = until(first, Packet(1, "commit", b"after"))
        assert [p for p in came if isinstance(p, Packet)] == [Packet(1, "commit", b"after")]


def test_strange_keys_are_dropped_and_counted() -> None:
    """Anyone on the bus may publish below our prefix."""
    a, b = endpoints()
    reasons: list[str] = []
    with (
        ZenohTransport("t", 0, 1, a, on_drop=reasons.append) as first,
        zenoh.open(configuration(b)) as stranger,
    ):
        time.sleep(0.2)
        for key in ("decmcts/v2/t/99/msg/commit", "decmcts/v2/t/x/msg/commit"):
            stranger.put(key, b"x")
        stranger.put(Keys("t").message(1, "commit"), b"fine")
        came = until(first, Packet(1, "commit", b"fine"))
    assert len(came) == 1
    assert reasons == ["bad key", "bad key"]


def test_an_undrained_receiver_blocks_nobody_and_keeps_the_newest() -> None:
    """A full default channel blocks the whole session and its close."""
    a, b = endpoints()
    with ZenohTransport("t", 0, 1, a) as first, ZenohTransport("t", 1, 1, b) as second:
        until(first, Presence(1, 1, True))
        until(second, Presence(0, 1, True))
        for i in range(5000):  # first does not receive meanwhile
            second.send("commit", b"%d" % i, reliable=True)
            if i % 500 == 0:
                time.sleep(0.02)
        first.send("commit", b"back", reliable=True)
        until(second, Packet(0, "commit", b"back"))
        until(first, Packet(1, "commit", b"4999"))
        began = time.monotonic()
    assert time.monotonic() - began < 3.0


def test_many_distributions_push_out_no_commit() -> None:
    """What a busy agent must hear may not be lost in what is soon out of date."""
    a, b = endpoints()
    with ZenohTransport("t", 0, 1, a) as first, ZenohTransport("t", 1, 1, b) as second:
        until(first, Presence(1, 1, True))
        second.send("commit", b"word", reliable=True)
        for i in range(1000):
            second.send("distribution", b"%d" % i, reliable=True)
        time.sleep(0.5)
        assert Packet(1, "commit", b"word") in first.receive(0.0)


def test_what_we_say_takes_no_place_of_what_we_hear() -> None:
    """A session hears itself unless it is told not to."""
    a, b = endpoints()
    with ZenohTransport("t", 0, 1, a) as first, ZenohTransport("t", 1, 1, b) as second:
        until(first, Presence(1, 1, True))
        until(second, Presence(0, 1, True))
        first.send("commit", b"theirs", reliable=True)
        time.sleep(0.2)
        for i in range(500):
            second.send("commit", b"%d" % i, reliable=True)
        time.sleep(0.2)
        assert second.receive(0.0) == [Packet(0, "commit", b"theirs")]


@pytest.mark.parametrize("heads", [2, 8, 64])
def test_what_waits_for_a_busy_agent_is_bounded(heads: int) -> None:
    """A ring of 1024 messages of 4 MiB was 4 GiB."""
    assert ring_size(heads) >= min(heads, 64)
    assert ring_size(heads) * len(KINDS) * MAX_MESSAGE_BYTES <= 144 * 2**20
    assert QUEUE_BYTES <= 16 * 2**20


def test_a_full_outgoing_queue_drops_the_oldest() -> None:
    """A hung peer must not make us keep all that was ever said."""
    reasons: list[str] = []
    transport = ZenohTransport("t", 0, 1, endpoints()[0], on_drop=reasons.append)
    for i in range(40):  # nothing sends: the session is not open
        transport.send("proposal", bytes([i]) * MAX_MESSAGE_BYTES, reliable=True)
    kept = [payload[0] for _, payload in transport._queue]
    assert kept == list(range(40 - QUEUE_BYTES // MAX_MESSAGE_BYTES, 40))
    assert len(reasons) == 40 - len(kept)


def test_only_the_newest_waiting_distribution_is_sent() -> None:
    """Old distributions are worthless: they must not queue up before new ones."""
    a, b = endpoints()
    with ZenohTransport("t", 0, 1, a) as first, ZenohTransport("t", 1, 1, b) as second:
        until(first, Presence(1, 1, True))
        for i in range(2000):
            second.send("distribution", b"%d" % i, reliable=False)
        came = until(first, Packet(1, "distribution", b"1999"))
    assert len(came) < 2000


def test_kill_9_is_seen_within_half_a_second() -> None:
    """A dead head's work must be re-assigned soon."""
    with child() as (transport, process):
        process.kill()
        began = time.monotonic()
        until(transport, Presence(1, 7, False))
        assert time.monotonic() - began < 0.5


def test_a_stopped_process_is_gone_after_its_lease_and_back_on_resume() -> None:
    """Hung is not dead: it must be noticed, and it must be let in again."""
    with child() as (transport, process):
        os.kill(process.pid, signal.SIGSTOP)
        began = time.monotonic()
        until(transport, Presence(1, 7, False))
        assert time.monotonic() - began < 2.5 * LEASE_MS / 1000
        os.kill(process.pid, signal.SIGCONT)
        until(transport, Presence(1, 7, True), 10.0)


@pytest.mark.parametrize(
    ("passed_s", "computed_s", "stopped"),
    [
        (0.02, 0.0, False),
        (0.9, 0.01, True),  # peers drop a process that is silent for so long
        (0.9, 0.2, True),  # ten threads computed before the stop
        (3.0, 2.9, False),  # a thread held the interpreter, and zenoh's own went on
        (4.0, 2.9, True),  # the same, and a stop
        (0.4, 0.0, False),
    ],
)
def test_a_stop_is_told_from_computing(passed_s: float, computed_s: float, stopped: bool) -> None:
    """A missed stop may cut a head off for good; a needless new session loses a moment."""
    assert stood_still(passed_s, computed_s) == stopped


def test_sending_to_a_stopped_process_never_blocks_the_planner() -> None:
    """A blocking put to a hung peer blocks for seconds; it must do so elsewhere."""
    with child() as (transport, process):
        os.kill(process.pid, signal.SIGSTOP)
        longest = 0.0
        for _ in range(200):
            began = time.monotonic()
            transport.send("commit", bytes(200_000), reliable=True)
            transport.send("distribution", bytes(200_000), reliable=False)
            longest = max(longest, time.monotonic() - began)
            time.sleep(0.005)
        assert longest < 0.2
        began = time.monotonic()
    # Closing a session during a put is an error in zenoh; ours waits for the put.
    assert time.monotonic() - began < 4.0


@pytest.mark.parametrize(
    "body", ["raise ValueError('uncaught')", "sys.exit(3)"], ids=["exception", "exit"]
)
def test_the_interpreter_exits_with_an_open_session(body: str) -> None:
    """An open callback subscriber hangs the exit for ever; ours must not."""
    text = CHILD.format(body=body)
    ports = ",".join(map(str, free_ports(2)))
    done = subprocess.run(
        [sys.executable, "-c", text, ports], timeout=20, stderr=subprocess.PIPE, check=False
    )
    assert done.returncode in (1, 3)


def test_a_taken_port_is_an_error_and_not_another_port() -> None:
    """The peers would look for us where we are not."""
    mine, _ = endpoints()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", int(mine.listen.rpartition(":")[2])))
        taken.listen()
        with pytest.raises(zenoh.ZError), ZenohTransport("t", 0, 1, mine):
            pass
