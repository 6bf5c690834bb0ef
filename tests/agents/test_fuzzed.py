"""What one who has the team's secret could say at worst: agents stay up, and small."""

from __future__ import annotations

import tracemalloc
import zlib
from collections.abc import Iterator

import msgpack
import numpy as np
import pytest

from agents.messages.codec import KINDS, MAX_MESSAGE_BYTES, encode, kind_of
from agents.messages.kinds import (
    VERSION,
    Beat,
    Commit,
    Distribution,
    Envelope,
    Goodbye,
    Hello,
    Joint,
    Message,
    PlanReply,
    PlanRequest,
    Proposal,
    Stage,
)
from agents.networks.memory import Weather
from agents.networks.transport import Packet
from tests.agents.simulation import Team

BOTH, DIGEST = (0, 1), "ab" * 16
ROW = np.arange(20, dtype=np.int32)
MESSAGES: tuple[Message, ...] = (
    Hello(DIGEST, VERSION, "head1", True),
    Distribution((ROW, ROW[:3]), np.array([0.25, 0.75])),
    Joint(BOTH, {0: ROW}, 12.5),
    Proposal(BOTH, {0: ROW, 1: ROW[:5]}, 12.5, DIGEST),
    Commit(BOTH, DIGEST, Stage.COMMITTED, 9, (9, 0)),
    PlanRequest(0, BOTH, DIGEST),
    PlanReply(0, Proposal(BOTH, {1: ROW}, 12.5, DIGEST)),
    Beat(40),
    Goodbye(DIGEST, "done"),
)


def inject(team: Team, kind: str, payload: bytes) -> None:
    """Put a message of head 1 before agent 0, as if it had the right seal."""
    team.network.transports[0].inbox.append(Packet(1, kind, payload))


def test_300_mutated_messages_bring_no_agent_down() -> None:
    """Bits, bytes, cuts and fields of every kind: dropped or heard, never an exception."""
    team, rng = Team(2, Weather(), limit_s=60.0), np.random.default_rng(42)
    team.run(0.5)
    for trial in range(300):
        message = MESSAGES[trial % len(MESSAGES)]
        number = int(rng.integers(2**62)) if trial % 5 else trial
        payload = bytearray(encode(Envelope(1, 1, number, message)))
        for _ in range(int(rng.integers(1, 4))):
            payload[int(rng.integers(len(payload)))] = int(rng.integers(256))
        cut = len(payload) if trial % 3 else int(rng.integers(len(payload)))
        inject(team, kind_of(message), bytes(payload[:cut]))
        team.run(0.02)
    assert team.agents[0].traffic.dropped["malformed message of head 1"] > 150
    assert not team.agents[0].done


def bomb(kind: str, numbers: int) -> bytes:
    """Return a message whose sequences unfold to so many numbers, as small as deflate makes it."""
    packed = [[numbers], 0, zlib.compress(bytes(numbers), 9)]
    proposal = [list(BOTH), [1], packed, 1.0, DIGEST, False]
    fields = {
        "distribution": [packed, np.float32([1.0]).tobytes()],
        "joint": [list(BOTH), [1], packed, 1.0],
        "proposal": proposal,
        "reply": [0, proposal],
    }[kind]
    made: bytes = msgpack.packb([kind, 1, 1, 2**40, *fields], use_bin_type=True)
    assert len(made) < 8000
    return made


def many(kind: str) -> Iterator[bytes]:
    """Yield 150 different messages of a kind, each as heavy as it gets."""
    for number in range(150):
        digest = f"{number:032x}"
        full = np.full(400, number, np.int32)
        told: dict[str, Message] = {
            "hello": Hello(digest, VERSION, "x" * 200, True),
            "distribution": Distribution((full,), np.ones(1)),
            "joint": Joint(BOTH, {1: full}, 0.1 + number),
            "proposal": Proposal(BOTH, {1: full}, 0.1, digest),
            "commit": Commit(BOTH, digest, Stage.COMMITTED, number, (0, 0)),
            "request": PlanRequest(0, BOTH, digest),
            "reply": PlanReply(0, Proposal(BOTH, {1: full}, 0.1, digest)),
            "beat": Beat(1 + number),
            "goodbye": Goodbye(digest, "y" * 200),
        }
        yield encode(Envelope(1, 1, 2**40 + number, told[kind]))


@pytest.mark.parametrize("kind", sorted(KINDS.values()))
def test_no_kind_of_message_makes_an_agent_grow(kind: str) -> None:
    """1 496 proposals of 3.9 kB each made every agent grow by 4 GiB."""
    team = Team(2, Weather(), limit_s=60.0)
    team.run(0.3)
    messages = list(many(kind))
    if kind in ("distribution", "joint", "proposal", "reply"):
        bombs = bomb(kind, 4_000_000), bomb(kind, 600)
        messages[::4] = [bombs[n % 2] for n in range(len(messages[::4]))]
    tracemalloc.start()
    try:
        for payload in messages:
            inject(team, kind, payload)
            team.agents[0].step()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 2**20 + MAX_MESSAGE_BYTES
