"""Messages over zenoh, with every trap of it closed.

Sessions are set up in `agents.networks.zenoh_session`. Received bytes go through ring
channels polled by the agent's own thread, so no callback of ours ever runs inside zenoh
and interpreter exit cannot hang on one; puts happen on a thread of their own, so a
blocked put never holds up planning.

Messages are sealed here as they leave and opened as they come (`agents.messages.seal`):
what lacks the team's seal is counted and goes no further.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Self

import zenoh

from agents.messages.codec import KINDS
from agents.messages.keys import Keys
from agents.messages.kinds import MessageError, Presence
from agents.messages.seal import ForgedError, Seal
from agents.networks.transport import FORGED, STRANGE, Arrival, Packet, Transport
from agents.networks.zenoh_session import LEASE_MS, open_session
from decmcts.errors import InputError

LOG = logging.getLogger(__name__)

RING_A_HEAD = 4
RINGS = range(16, 65)
"""Messages of each kind kept for a busy agent: some for each head, in all at most
64 of 256 KiB. A full default FIFO would block the whole session, other subscribers
and `close` included; a ring drops the oldest, and the protocol says again what
matters. A ring for each kind, so that many distributions push out no commit."""

TOKENS = 1024  # liveliness tokens kept; they carry nothing, and a lost one would be missed
QUEUE_BYTES = 4 * 1024 * 1024  # waiting to be sent; a hung peer holds it up for a lease
RETRY_S = 0.5  # so often a place is tried again that could not be opened
POLL_S = 0.001
WATCH_S = 0.02  # short, so that threads hardly compute in it before a stop
STOPPED_S = 0.5 * LEASE_MS / 1000
"""A process that stood still for so long may have been dropped by its peers:
zenoh says that it lives every quarter of a lease, perhaps just before the stop."""

CLOSE_S = 1.5
FLUSH_S = 1.0  # what waits is still sent so long after closing began
JOIN_S = 8.0  # a put to a hung peer returns after a lease; zenoh's default would be 5 s


def ring_size(heads: int) -> int:
    """Return how many messages of each kind are kept in a mesh of so many heads."""
    return min(max(RING_A_HEAD * heads, RINGS.start), RINGS.stop - 1)


def stood_still(passed_s: float, computed_s: float) -> bool:
    """Tell whether a sleep of `WATCH_S` took so long because the process was stopped.

    Not if it computed meanwhile, on another thread that held the interpreter. A process
    that is starved looks like a stopped one; taking it for one costs a new session only.
    """
    return passed_s - WATCH_S - computed_s > STOPPED_S


class ZenohTransport(Transport):
    """One head's zenoh session; use as a context manager.

    Parameters
    ----------
    places : sequence of str
        Where each head listens, as zenoh locators.
    on_drop : callable
        Told the reason of every message that is dropped here.
    on_shut : callable
        Told, once for each set of places, that ours cannot be opened. It is tried again and
        again, until there are other places. None: raise `InputError` instead.
    """

    def __init__(
        self,
        seal: Seal,
        head: int,
        epoch: int,
        places: Sequence[str],
        *,
        on_drop: Callable[[str], None] = lambda reason: None,
        on_shut: Callable[[str], None] | None = None,
        kinds: Sequence[str] = tuple(KINDS.values()),
    ) -> None:
        self._kinds = tuple(kinds)
        self._seal, self._keys = seal, Keys(seal)
        self._head = head
        self._epoch = epoch
        self._places = tuple(places)
        self._on_drop, self._on_shut = on_drop, on_shut
        self._ring = ring_size(len(places))
        self._session: zenoh.Session | None = None
        self._shut_until = math.inf  # when to try again where it is not open
        self._is_shut_reported = False
        self._queue: deque[tuple[str, bytes]] = deque()
        self._queued_bytes = 0
        self._latest: dict[str, bytes] = {}  # unreliable kinds: only the newest waits
        self._ready = threading.Condition()
        self._closing_until: float | None = None
        self._using = threading.Lock()  # a put, or closing and opening the session
        self._was_stopped = False  # long enough for peers to drop us
        self._stack = ExitStack()
        self._seen: set[tuple[int, int]] = set()  # (head, epoch) said to be here

    def __enter__(self) -> Self:
        """Open the session, subscribe, then announce this head."""
        self._open()
        self._sender = threading.Thread(target=self._send_all, name="zenoh-put", daemon=True)
        self._sender.start()
        threading.Thread(target=self._watch, name="zenoh-watch", daemon=True).start()
        return self

    def _open(self) -> None:
        try:
            with ExitStack() as stack:
                # Always `with`: a session left open by an exception hangs the exit.
                session = stack.enter_context(open_session(self._places, self._head, self._seal))
                self._messages = [
                    session.declare_subscriber(
                        self._keys.all_messages(kind), zenoh.handlers.RingChannel(self._ring)
                    )
                    for kind in self._kinds
                ]
                self._alive = session.liveliness().declare_subscriber(
                    self._keys.all_alive, zenoh.handlers.RingChannel(TOKENS), history=True
                )
                token = self._keys.alive(self._head, self._epoch)
                self._token = session.liveliness().declare_token(token)
                self._stack, self._session = stack.pop_all(), session
                self._shut_until, self._is_shut_reported = math.inf, False
        except InputError as error:
            if self._on_shut is None:
                raise
            self._shut_until = time.monotonic() + RETRY_S
            if not self._is_shut_reported:
                self._is_shut_reported = True
                self._on_shut(str(error))

    def _close(self) -> None:
        self._session = None
        try:
            self._stack.close()
        except zenoh.ZError as failed:  # a hung peer; the session is given up all the same
            LOG.warning("zenoh did not close in time: %s", failed)

    def __exit__(self, *error: object) -> None:
        """Send what waits (briefly), then close."""
        with self._ready:
            self._closing_until = time.monotonic() + FLUSH_S
            self._ready.notify()
        # zenoh raises "Already borrowed" when closed during a put: wait for it.
        self._sender.join(JOIN_S)
        # Beside the caller: with a hung peer zenoh may take its 10 s to close.
        closing = threading.Thread(target=self._close, name="zenoh-close", daemon=True)
        closing.start()
        closing.join(CLOSE_S)

    def move(self, places: Sequence[str]) -> None:
        """Meet the others at other places from the next `receive` on."""
        self._places, self._is_shut_reported = tuple(places), False
        self._shut_until = 0.0

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
            again = self._was_stopped or time.monotonic() >= self._shut_until
            arrivals: list[Arrival] = self._begin_again() if again else []
            if self._session is not None:
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
            except MessageError as error:
                self._on_drop(f"{FORGED} token" if isinstance(error, ForgedError) else STRANGE)
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
            payload = self._seal.open(sample.payload.to_bytes())
        except MessageError as error:
            self._on_drop(f"{FORGED} message" if isinstance(error, ForgedError) else STRANGE)
            return None
        return None if head == self._head else Packet(head, kind, payload)

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
        control, priority = zenoh.CongestionControl, zenoh.Priority
        try:
            # BLOCK waits up to 5 s for a hung peer, here and not in planning.
            # Its own priority has its own queue, so bulk never delays commits.
            with self._using:
                if self._session is None:
                    return  # no place to speak at; what matters is said again
                self._session.put(
                    self._keys.message(self._head, kind),
                    self._seal.close(payload),
                    congestion_control=control.BLOCK if reliable else control.DROP,
                    priority=priority.INTERACTIVE_HIGH if reliable else priority.DATA,
                    express=reliable,
                    # Else our own session keeps it too, in the place of a peer's.
                    allowed_destination=zenoh.Locality.REMOTE,
                )
        except zenoh.ZError as error:
            self._on_drop(f"put failed: {error}")
