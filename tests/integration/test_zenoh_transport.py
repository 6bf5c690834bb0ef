"""Real zenoh sessions on loopback: every trap of the library stays closed."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path

import pytest
import zenoh

from agents.launching.places import Places, free_ports
from agents.messages.codec import KINDS, MAX_MESSAGE_BYTES
from agents.messages.keys import Keys
from agents.messages.kinds import Presence
from agents.messages.seal import Seal
from agents.networks.transport import Arrival, Packet
from agents.networks.zenoh_session import LEASE_MS, configured
from agents.networks.zenoh_transport import QUEUE_BYTES, ZenohTransport, ring_size, stood_still
from decmcts.errors import InputError
from tests.agents.sealed import OTHER, SEAL

pytestmark = pytest.mark.slow

KEYS = (
    "listen/endpoints",
    "connect/endpoints",
    "scouting/multicast/enabled",
    "scouting/gossip/enabled",
    "transport/shared_memory/enabled",
    "transport/link/tx/lease",
    "transport/link/rx/max_message_size",
    "transport/link/protocols",
)

CHILD = """
import sys, time
from agents.messages.seal import Seal
from agents.networks.zenoh_transport import ZenohTransport
places = sys.argv[1].split(",")
with ZenohTransport(Seal.of(bytes(range(32))), 1, 7, places) as transport:
    while True:
        transport.send("commit", b"from the child", reliable=True)
        {body}
        transport.receive(0.02)
"""


def tcp_places(n: int = 2) -> list[str]:
    return [f"tcp/127.0.0.1:{port}" for port in free_ports(n)]


@pytest.fixture
def places() -> Iterator[tuple[str, ...]]:
    """Sockets for three heads in a folder of their own."""
    with Places(3) as made:
        yield made.fresh()


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
    text = CHILD.format(body=body)
    with Places(2) as made:
        places = made.fresh()
        process = subprocess.Popen([sys.executable, "-c", text, ",".join(places)])
        try:
            with ZenohTransport(SEAL, 0, 1, places) as transport:
                until(transport, Presence(1, 7, True), 20.0)
                yield transport, process
        finally:
            process.kill()
            process.wait()


def test_the_configuration_closes_every_insecure_default() -> None:
    """zenoh listens on all interfaces, scouts, gossips and takes 1 GiB unless told not to."""
    with configured("tcp/127.0.0.1:7447", ["tcp/127.0.0.1:7448"], SEAL) as config:
        known = {key: json.loads(config.get_json(key)) for key in KEYS}

    def value(key: str) -> object:
        return known[key]

    assert value("listen/endpoints") == ["tcp/127.0.0.1:7447"]
    assert value("connect/endpoints") == ["tcp/127.0.0.1:7448"]
    assert value("scouting/multicast/enabled") is False
    assert value("scouting/gossip/enabled") is False
    assert value("transport/shared_memory/enabled") is False
    assert value("transport/link/tx/lease") == LEASE_MS == 1000
    assert value("transport/link/rx/max_message_size") < 5 * 2**20
    assert value("transport/link/protocols") == ["tcp"]


def test_a_session_on_sockets_listens_at_no_port(places: tuple[str, ...]) -> None:
    """Another host, or another user of this one, must not reach an agent."""
    with ZenohTransport(SEAL, 0, 1, places):
        assert not listening()
        folder = Path(places[0].removeprefix("unixsock-stream/")).parent
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def listening() -> set[str]:
    """Return the addresses this process listens at."""
    mine = {os.readlink(name) for name in Path("/proc/self/fd").iterdir() if name.exists()}
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return {r[1] for r in rows if r[3] == "0A" and f"socket:[{r[9]}]" in mine}


def test_a_session_on_ports_listens_on_loopback_only() -> None:
    """Another host must not reach an agent."""
    mine = tcp_places()
    port = int(mine[0].rpartition(":")[2])
    with ZenohTransport(SEAL, 0, 1, mine):
        assert listening() == {f"0100007F:{port:04X}"}


def test_three_peers_hear_each_other_in_a_full_mesh(places: tuple[str, ...]) -> None:
    """Peers do not relay: each needs a link to each."""
    with (
        ZenohTransport(SEAL, 0, 1, places) as first,
        ZenohTransport(SEAL, 1, 1, places) as second,
        ZenohTransport(SEAL, 2, 1, places) as third,
    ):
        for me, transport in enumerate((first, second, third)):
            until_all(transport, {Presence(h, 1, True) for h in range(3) if h != me})
        third.send("commit", b"x", reliable=True)
        third.send("distribution", b"y", reliable=False)
        for transport in (first, second):
            until_all(transport, {Packet(2, "commit", b"x"), Packet(2, "distribution", b"y")})


def test_sessions_of_other_names_do_not_mix(places: tuple[str, ...]) -> None:
    """Two prints planned on one host at once must not hear each other."""
    with ZenohTransport(SEAL, 0, 1, places) as first, ZenohTransport(OTHER, 1, 1, places) as second:
        second.send("commit", b"x", reliable=True)
        assert first.receive(0.5) == []


def test_a_peer_that_starts_later_is_still_connected_to(places: tuple[str, ...]) -> None:
    """With a connect timeout of 0 zenoh tries once and never again."""
    with ZenohTransport(SEAL, 0, 1, places) as first:
        assert first.receive(0.3) == []
        with ZenohTransport(SEAL, 1, 1, places):
            until(first, Presence(1, 1, True))


def test_a_closed_session_is_seen_to_leave(places: tuple[str, ...]) -> None:
    """The others re-assign its work at once."""
    with ZenohTransport(SEAL, 0, 1, places) as first:
        with ZenohTransport(SEAL, 1, 3, places):
            until(first, Presence(1, 3, True))
        until(first, Presence(1, 3, False))


def test_an_oversized_message_is_dropped_and_the_link_lives_on(places: tuple[str, ...]) -> None:
    """One bad message must not cut a head off."""
    with ZenohTransport(SEAL, 0, 1, places) as first, ZenohTransport(SEAL, 1, 1, places) as second:
        until(first, Presence(1, 1, True))
        second.send("commit", bytes(MAX_MESSAGE_BYTES + 10_000), reliable=True)
        second.send("commit", b"after", reliable=True)
        came = until(first, Packet(1, "commit", b"after"))
        assert [p for p in came if isinstance(p, Packet)] == [Packet(1, "commit", b"after")]


def test_strange_keys_are_dropped_and_counted(places: tuple[str, ...]) -> None:
    """Whoever is on the bus may publish below our prefix."""
    reasons: list[str] = []
    with (
        ZenohTransport(SEAL, 0, 1, places, on_drop=reasons.append) as first,
        stranger(places[0], SEAL) as neighbour,
    ):
        time.sleep(0.3)
        root = f"decmcts/v3/{SEAL.session}"
        for key in (f"{root}/99/msg/commit", f"{root}/x/msg/commit"):
            neighbour.put(key, b"x")
        neighbour.put(Keys(SEAL).message(1, "commit"), SEAL.close(b"fine"))
        came = until(first, Packet(1, "commit", b"fine"))
    assert len(came) == 1
    assert reasons == ["strange key", "strange key"]


def test_an_undrained_receiver_blocks_nobody_and_keeps_the_newest(places: tuple[str, ...]) -> None:
    """A full default channel blocks the whole session and its close."""
    with ZenohTransport(SEAL, 0, 1, places) as first, ZenohTransport(SEAL, 1, 1, places) as second:
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


def test_many_distributions_push_out_no_commit(places: tuple[str, ...]) -> None:
    """What a busy agent must hear may not be lost in what is soon out of date."""
    with ZenohTransport(SEAL, 0, 1, places) as first, ZenohTransport(SEAL, 1, 1, places) as second:
        until(first, Presence(1, 1, True))
        second.send("commit", b"word", reliable=True)
        for i in range(1000):
            second.send("distribution", b"%d" % i, reliable=True)
        time.sleep(0.5)
        assert Packet(1, "commit", b"word") in first.receive(0.0)


def test_what_we_say_takes_no_place_of_what_we_hear(places: tuple[str, ...]) -> None:
    """A session hears itself unless it is told not to."""
    with ZenohTransport(SEAL, 0, 1, places) as first, ZenohTransport(SEAL, 1, 1, places) as second:
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


def test_a_full_outgoing_queue_drops_the_oldest(places: tuple[str, ...]) -> None:
    """A hung peer must not make us keep all that was ever said."""
    reasons: list[str] = []
    transport = ZenohTransport(SEAL, 0, 1, places, on_drop=reasons.append)
    for i in range(40):  # nothing sends: the session is not open
        transport.send("proposal", bytes([i]) * MAX_MESSAGE_BYTES, reliable=True)
    kept = [payload[0] for _, payload in transport._queue]
    assert kept == list(range(40 - QUEUE_BYTES // MAX_MESSAGE_BYTES, 40))
    assert len(reasons) == 40 - len(kept)


def test_only_the_newest_waiting_distribution_is_sent(places: tuple[str, ...]) -> None:
    """Old distributions are worthless: they must not queue up before new ones."""
    with ZenohTransport(SEAL, 0, 1, places) as first, ZenohTransport(SEAL, 1, 1, places) as second:
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
    ports = ",".join(tcp_places())
    done = subprocess.run(
        [sys.executable, "-c", text, ports], timeout=20, stderr=subprocess.PIPE, check=False
    )
    assert done.returncode in (1, 3)


def test_a_taken_port_is_an_error_in_our_words() -> None:
    """The peers would look for us where we are not; and nobody reads zenoh's errors."""
    mine = tcp_places()
    with taken(mine[0]), pytest.raises(InputError, match=r"cannot listen at the address 127\S+;"):
        ZenohTransport(SEAL, 0, 1, mine).__enter__()


@contextmanager
def taken(place: str) -> Iterator[None]:
    """Listen at a port as somebody else."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", int(place.rpartition(":")[2])))
        other.listen()
        yield


def test_a_place_that_cannot_be_opened_is_left_for_another(places: tuple[str, ...]) -> None:
    """Somebody took the port; the launcher has all meet elsewhere."""
    ports, reasons = tcp_places(3), []
    with (
        taken(ports[0]),
        ZenohTransport(SEAL, 0, 1, ports, on_shut=reasons.append) as first,
        ZenohTransport(SEAL, 1, 1, ports) as second,
    ):
        assert first.receive(0.1) == [] and len(reasons) == 1
        first.send("commit", b"lost", reliable=True)
        for transport in (first, second):
            transport.move(places)
        until_both(first, second)
        first.send("commit", b"x", reliable=True)
        until(second, Packet(0, "commit", b"x"))
    assert len(reasons) == 1


def until_both(first: ZenohTransport, second: ZenohTransport) -> None:
    """Let heads 0 and 1 find each other."""
    seen: list[Arrival] = []
    deadline = time.monotonic() + 10.0
    while not {Presence(0, 1, True), Presence(1, 1, True)} <= set(seen):
        seen += [*first.receive(0.02), *second.receive(0.02)]
        assert time.monotonic() < deadline


def test_a_session_whose_folder_is_gone_says_so_and_moves(places: tuple[str, ...]) -> None:
    """Stopped for longer than its lease it must listen anew, and cannot."""
    reasons: list[str] = []
    with (
        Places(3) as others,
        ZenohTransport(SEAL, 0, 1, places, on_shut=reasons.append) as first,
        ZenohTransport(SEAL, 1, 1, places) as second,
    ):
        until_both(first, second)
        shutil.rmtree(Path(places[0].removeprefix("unixsock-stream/")).parent)
        first._was_stopped = True
        assert first.receive(0.0) == [Presence(1, 1, False)] and len(reasons) == 1
        fresh = others.fresh()
        first.move(fresh)
        second.move(fresh)
        until_both(first, second)


@contextmanager
def stranger(place: str, seal: Seal | None) -> Iterator[zenoh.Session]:
    """Open a session that connects to a head: with the password of a seal, or with none."""
    with (
        nullcontext(zenoh.Config())
        if seal is None
        else configured("unixsock-stream/none", [], seal)
    ) as config:
        config.insert_json5("mode", '"peer"')
        config.insert_json5("scouting/multicast/enabled", "false")
        config.insert_json5("listen/endpoints", "[]")
        config.insert_json5("connect/endpoints", json.dumps([place]))
        session = zenoh.open(config)
    with session:
        yield session


@pytest.mark.parametrize("seal", [None, OTHER])
def test_who_lacks_the_password_hears_nothing_and_is_not_heard(
    places: tuple[str, ...], seal: Seal | None
) -> None:
    """Any process of the host could join, and one forged goodbye cost a head."""
    reasons: list[str] = []
    with (
        ZenohTransport(SEAL, 0, 1, places, on_drop=reasons.append) as first,
        ZenohTransport(SEAL, 1, 1, places) as second,
        stranger(places[0], seal) as intruder,
    ):
        until_both(first, second)
        heard = intruder.declare_subscriber("**", zenoh.handlers.RingChannel(64))
        token = intruder.liveliness().declare_token(Keys(SEAL).alive(1, 99))
        for _ in range(20):
            intruder.put(Keys(SEAL).message(1, "goodbye"), SEAL.close(b"forged"))
            second.send("commit", b"x", reliable=True)
            time.sleep(0.01)
        came = until(first, Packet(1, "commit", b"x"))
        token.undeclare()
        own = [s for s in iter(heard.try_recv, None) if str(s.key_expr).endswith("commit")]
    assert {type(a) for a in came} == {Packet} and {a.kind for a in came} == {"commit"}
    assert own == [] and reasons == []


def test_what_is_forged_inside_the_session_is_counted(places: tuple[str, ...]) -> None:
    """Who has the password but not the seals' key: somebody who listens in on a wire."""
    reasons: list[str] = []
    with (
        ZenohTransport(SEAL, 0, 1, places, on_drop=reasons.append) as first,
        ZenohTransport(SEAL, 1, 1, places) as second,
        stranger(places[0], SEAL) as intruder,
    ):
        until_both(first, second)
        time.sleep(0.3)
        keys = Keys(SEAL)
        key = keys.alive(1, 2**60)
        token = intruder.liveliness().declare_token(key[:-32] + "0" * 32)
        intruder.put(keys.message(1, "goodbye"), b"forged")
        intruder.put(keys.message(1, "goodbye"), OTHER.close(b"forged"))
        second.send("commit", b"x", reliable=True)
        came = until(first, Packet(1, "commit", b"x"))
        came += first.receive(0.3)
        token.undeclare()
    assert came == [Packet(1, "commit", b"x")]
    assert sorted(reasons) == ["forged message", "forged message", "forged token"]
