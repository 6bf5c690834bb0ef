"""The test network does what it says: a lenient one would prove nothing."""

from __future__ import annotations

import numpy as np
import pytest

from agents.messages.kinds import Presence
from agents.networks.memory import MemoryTransport, Weather
from agents.networks.transport import Packet
from tests.agents.faulty_network import FaultyNetwork


def pair(weather: Weather, seed: int = 0) -> tuple[FaultyNetwork, MemoryTransport, MemoryTransport]:
    network = FaultyNetwork(np.random.default_rng(seed), weather)
    first = MemoryTransport(network, 0, 1).__enter__()
    second = MemoryTransport(network, 1, 2).__enter__()
    network.advance(0.01)
    return network, first, second


def payloads(transport: MemoryTransport) -> list[bytes]:
    return [a.payload for a in transport.receive(0.0) if isinstance(a, Packet)]


def test_in_fair_weather_everything_arrives_once_in_order() -> None:
    """The base the disturbances are added to."""
    network, first, second = pair(Weather())
    assert first.receive(0.0) == [Presence(1, 2, True)]
    for i in range(50):
        first.send("commit", b"%d" % i, reliable=True)
    network.advance(0.01)
    assert payloads(second) == [b"%d" % i for i in range(50)]
    assert payloads(first) == []


@pytest.mark.parametrize("seed", range(3))
def test_a_storm_loses_doubles_and_reorders(seed: int) -> None:
    """All three must happen, or the agreement tests are for nothing."""
    weather = Weather(loss=0.3, delay_s=(0.0, 1.0), duplicate=0.3)
    network, first, second = pair(weather, seed)
    for i in range(400):
        first.send("commit", b"%03d" % i, reliable=True)
    network.advance(2.0)
    came = payloads(second)
    assert 0.6 < len(set(came)) / 400 < 0.9
    assert len(came) > len(set(came))
    assert came != sorted(came)


def test_equal_seeds_give_equal_weather() -> None:
    """A failure must be seen again."""
    weather = Weather(loss=0.3, delay_s=(0.0, 1.0), duplicate=0.3)
    came = []
    for _ in range(2):
        network, first, second = pair(weather, 5)
        for i in range(50):
            first.send("commit", b"%d" % i, reliable=True)
        network.advance(2.0)
        came.append(payloads(second))
    assert came[0] == came[1]


def test_a_hung_head_is_gone_after_its_lease_and_hears_nothing() -> None:
    """Like a stopped process under zenoh."""
    network, first, second = pair(Weather())
    first.receive(0.0)
    network.hang(1)
    first.send("commit", b"x", reliable=True)
    network.advance(0.9)
    assert first.receive(0.0) == []
    network.advance(0.2)
    assert first.receive(0.0) == [Presence(1, 2, False)]
    network.resume(1)
    network.advance(1.1)
    assert first.receive(0.0) == [Presence(1, 2, True)]
    assert payloads(second) == []


def test_a_killed_head_is_gone_at_once_and_stays_gone() -> None:
    """No token of a dead head may arrive late and raise it."""
    network, first, _ = pair(Weather())
    first.receive(0.0)
    network.hang(1)
    network.resume(1)
    network.kill(1)
    network.advance(5.0)
    arrived = first.receive(0.0)
    assert arrived and arrived[-1] == Presence(1, 2, False)
    assert Presence(1, 2, True) not in arrived
