"""The one place that touches zenoh, with every trap of it closed.

Agents are peers on loopback with explicit endpoints in a full mesh, because
peers do not relay. Nothing is discovered, nothing listens beyond 127.0.0.1.
Received bytes go through ring channels polled by the agent's own thread, so no
callback of ours ever runs inside zenoh and interpreter exit cannot hang on
one; puts happen on a thread of their own, so a blocked put never holds up
planning.
"""

from __future__ import annotations

import json
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import zenoh

from agents.messages.codec import KINDS, MAX_MESSAGE_BYTES
from agents.messages.keys import Keys
from agents.messages.kinds import MessageError
from agents.networks.transport import Arrival, Packet, Presence

LOG = logging.getLogger(__name__)

LEASE_MS = 1000
"""A peer silent for so long is gone; zenoh's default is 10 s."""

RING_A_HEAD = 4
RINGS = range(16, 65)
"""Messages of each kind kept for a busy agent: some for each head, in all at most
64 of 256 KiB. A full default FIFO would block the whole session, other subscribers
and `close` included; a ring drops the oldest, and the protocol says again what
matters. A ring for each kind, so that many distributions push out no commit."""

TOKENS = 1024
"""Liveliness tokens kept; they carry nothing, and a lost one would be missed."""

QUEUE_BYTES = 4 * 1024 * 1024
"""Waiting to be sent; a hung peer holds it up for a lease."""

POLL_S = 0.001
WATCH_S = 0.02  # short, so that threads hardly compute in it before a stop
STOPPED_S = 0.5 * LEASE_MS / 1000
"""A process that stood still for so long may have been dropped by its peers:
zenoh says that it lives every quarter of a lease, perhaps just before the stop."""

CLOSE_S = 1.5
FLUSH_S = 1.0
"""What waits is still sent so long after closing began."""

JOIN_S = 8.0
"""A put to a hung peer returns after a lease; zenoh's default would be 5 s."""


@dataclass(frozen=True, slots=True)
class Endpoints:
    """Where one agent listens and whom it connects to, as zenoh locators."""

    listen: str
    connect: tuple[str, ...]

    @staticmethod
    def mesh(ports: Sequence[int], head: int) -> Endpoints:
        """Return the loopback endpoints of one head of a full mesh."""
        locators = [f"tcp/127.0.0.1:{port}" for port in ports]
        others = tuple(at for h, at in enumerate(locators) if h != head)
        return Endpoints(locators[head], others)


def configuration(endpoints: Endpoints) -> zenoh.Config:
    """Return the zenoh configuration of an agent; every insecure default is set."""
    settings: dict[str, object] = {
        "mode": "peer",
        "listen/endpoints": [endpoints.listen],  # default: all interfaces
        "connect/endpoints": list(endpoints.connect),
        # Peers may start later: keep trying, in the background. With a timeout
        # of 0 zenoh tries once and never again.
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {
            "period_init_ms": 50,
            "period_max_ms": 500,
            "period_increase_factor": 2,
        },
        # A stopped process still accepts TCP: give its handshake up after a lease
        # too (default 10 s), or closing waits for it.
        "transport/unicast/open_timeout": LEASE_MS,
        "transport/unicast/accept_timeout": LEASE_MS,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/protocols": ["tcp"],
        "transport/link/rx/max_message_size": MAX_MESSAGE_BYTES + 4096,  # default: 1 GiB
        "transport/link/tx/lease": LEASE_MS,
        # A blocked put to a hung peer gives it up after this; default: 5 s, in
        # which nothing reliable would reach the other peers either.
        "transport/link/tx/queue/congestion_control/block/wait_before_close": LEASE_MS * 1000,
        "transport/shared_memory/enabled": False,  # loses promoted queries under load
    }
    config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


def ring_size(heads: int) -> int:
    """Return how many messages of each kind are kept in a mesh of so many heads."""
    return min(max(RING_A_HEAD * heads, RINGS.start), RINGS.stop - 1)


def stood_still(passed_s: float, computed_s: float) -> bool:
    """Tell whether a sleep of `WATCH_S` took so long because the process was stopped.

    Not if it computed meanwhile, on another thread that held the interpreter. A process
    that is starved looks like a stopped one; taking it for one costs a new session only.
    """
    return passed_s - WATCH_S - computed_s > STOPPED_S


class ZenohTransport:
    """One head's zenoh session; use as a context manager.

    Parameters
    ----------
    session : str
        Name shared by the agents of one print.
    head, epoch : int
        Who we are; the liveliness token names both.
    endpoints : Endpoints
        Loopback locators.
    on_drop : callable
        Told the reason of every message that is dropped here.
    """

    def __init__(
        self,
        session: str,
        head: int,
        epoch: int,
        endpoints: Endpoints,
        *,
        on_drop: Callable[[str], None] = lambda reason: None,
    ) -> None:
        self._keys = Keys(session)
        self._head = head
        self._epoch = epoch
        self._endpoints = endpoints
        self._on_drop = on_drop
        self._ring = ring_size(1 + len(endpoints.connect))
        self._queue: deque[tuple[str, bytes]] = deque()
        self._queued_bytes = 0
        self._latest: dict[str, bytes] = {}  # unreliable kinds: only the newest waits
        self._ready = threading.Condition()
        self._closing_until: float | None = None
        self._using = threading.Lock()  # a put, or closing and opening the session
        self._was_stopped = False  # long enough for peers to drop us
        self._seen: set[tuple[int, int]] = set()  # (head, epoch) said to be here

    def __enter__(self) -> Self:
        """Open the session, subscribe, then announce this head."""
        self._open()
        self._sender = threading.Thread(target=self._send_all, name="zenoh-put", daemon=True)
        self._sender.start()
        threading.Thread(target=self._watch, name="zenoh-watch", daemon=True).start()
        return self

    def _open(self) -> None:
        with ExitStack() as stack:
            # Always `with`: a session left open by an exception hangs the exit.
            self._session = stack.enter_context(zenoh.open(configuration(self._endpoints)))
            self._messages = [
                self._session.declare_subscriber(
                    self._keys.all_messages(kind), zenoh.handlers.RingChannel(self._ring)
                )
                for kind in KINDS.values()
            ]
            self._alive = self._session.liveliness().declare_subscriber(
                self._keys.all_alive, zenoh.handlers.RingChannel(TOKENS), history=True
            )
            token = self._keys.alive(self._head, self._epoch)
            self._token = self._session.liveliness().declare_token(token)
            self._stack = stack.pop_all()

    def _close(self) -> None:
        try:
            self._stack.close()
        except zenoh.ZError as failed:  # a hung peer; the session is given up all the same
            LOG.warning("zenoh did not close in time: %s", failed)

    def _close_soon(self) -> None:
        """Close beside the caller: with a hung peer zenoh may take its 10 s."""
        closing = threading.Thread(target=self._close, name="zenoh-close", daemon=True)
        closing.start()
        closing.join(CLOSE_S)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Send what waits (briefly), then close."""
        with self._ready:
            self._closing_until = time.monotonic() + FLUSH_S
            self._ready.notify()
        # zenoh raises "Already borrowed" when closed during a put: wait for it.
        self._sender.join(JOIN_S)
        self._close_soon()

    def _begin_again(self) -> list[Arrival]:
        """Open a new session after a stop; all peers are gone until they are seen again.

        Peers may have closed their links when the lease ran out, and zenoh does not always
        find back to them: half-open handshakes of both sides can keep refusing each other.
        """
        gone: list[Arrival] = [Presence(head, epoch, False) for head, epoch in sorted(self._seen)]
        self._seen.clear()
        with self._using:
            self._was_stopped = False
            self._close()
            self._open()
        return gone

    def send(self, kind: str, payload: bytes, *, reliable: bool) -> None:
        """Queue bytes for all peers; a full queue drops the oldest."""
        with self._ready:
            if not reliable:
                self._latest[kind] = payload
            else:
                self._queue.append((kind, payload))
                self._queued_bytes += len(payload)
                while self._queued_bytes > QUEUE_BYTES:
                    self._queued_bytes -= len(self._queue.popleft()[1])
                    self._on_drop("outgoing queue full")
            self._ready.notify()

    def receive(self, timeout_s: float) -> list[Arrival]:
        """Return what arrived, waiting at most `timeout_s` for the first."""
        deadline = time.monotonic() + timeout_s
        while True:
            arrivals: list[Arrival] = self._begin_again() if self._was_stopped else []
            arrivals += [*self._presences(), *self._packets()]
            left = deadline - time.monotonic()
            if arrivals or left <= 0:
                return arrivals
            time.sleep(min(POLL_S, left))

    def _presences(self) -> list[Arrival]:
        found: list[Arrival] = []
        while (sample := self._alive.try_recv()) is not None:
            try:
                head, epoch = self._keys.parse_alive(str(sample.key_expr))
            except MessageError:
                self._on_drop("bad key")
                continue
            if head != self._head:
                here = sample.kind == zenoh.SampleKind.PUT
                (self._seen.add if here else self._seen.discard)((head, epoch))
                found.append(Presence(head, epoch, here))
        return found

    def _packets(self) -> list[Packet]:
        found: list[Packet] = []
        for messages in self._messages:
            for _ in range(self._ring):  # not while there are any: a flood never ends
                if (sample := messages.try_recv()) is None:
                    break
                if (packet := self._packet(sample)) is not None:
                    found.append(packet)
        return found

    def _packet(self, sample: zenoh.Sample) -> Packet | None:
        try:
            head, kind = self._keys.parse_message(str(sample.key_expr))
        except MessageError:
            self._on_drop("bad key")
            return None
        return None if head == self._head else Packet(head, kind, sample.payload.to_bytes())

    def _send_all(self) -> None:
        while (batch := self._next_batch()) is not None:
            for kind, payload, reliable in batch:
                if self._closing_until is None or time.monotonic() < self._closing_until:
                    self._put(kind, payload, reliable=reliable)

    def _watch(self) -> None:
        """Notice that this process was stopped while it slept for a moment."""
        while self._closing_until is None:
            began, used = time.monotonic(), time.process_time()
            time.sleep(WATCH_S)
            if stood_still(time.monotonic() - began, time.process_time() - used):
                self._was_stopped = True  # `receive` opens a new session

    def _next_batch(self) -> list[tuple[str, bytes, bool]] | None:
        with self._ready:
            self._ready.wait_for(
                lambda: self._queue or self._latest or self._closing_until is not None
            )
            batch = [(kind, payload, True) for kind, payload in self._queue]
            batch += [(kind, payload, False) for kind, payload in self._latest.items()]
            self._queue.clear()
            self._queued_bytes = 0
            self._latest.clear()
            return batch or None

    def _put(self, kind: str, payload: bytes, *, reliable: bool) -> None:
        control = zenoh.CongestionControl
        priority = zenoh.Priority
        try:
            # BLOCK waits up to 5 s for a hung peer, here and not in planning.
            # Its own priority has its own queue, so bulk never delays commits.
            with self._using:
                self._session.put(
                    self._keys.message(self._head, kind),
                    payload,
                    congestion_control=control.BLOCK if reliable else control.DROP,
                    priority=priority.INTERACTIVE_HIGH if reliable else priority.DATA,
                    express=reliable,
                    # Else our own session keeps it too, in the place of a peer's.
                    allowed_destination=zenoh.Locality.REMOTE,
                )
        except zenoh.ZError as error:
            self._on_drop(f"put failed: {error}")
