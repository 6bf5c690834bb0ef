"""Agents are given ports that stay free, and only limits they keep."""

from __future__ import annotations

import socket

import pytest

from agents.launching import places, spawn
from decmcts.search.sequence.stopping import Stopping


def test_ports_are_different_and_can_be_listened_on() -> None:
    ports = places.free_ports(64)
    assert len(set(ports)) == 64
    assert set(ports) <= set(places.PORTS)
    for port in ports:
        with socket.create_server(("127.0.0.1", port)):
            pass


def test_outgoing_connections_get_other_ports() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        for _ in range(50):
            with socket.create_connection(server.getsockname()) as client:
                assert client.getsockname()[1] not in places.PORTS


def test_a_port_in_use_is_not_offered() -> None:
    with socket.create_server(("127.0.0.1", places.free_ports(1)[0])) as server:
        taken = server.getsockname()[1]
        with pytest.raises(OSError, match="no 1 free ports"):
            places.free_ports(1, range(taken, taken + 1))


@pytest.mark.parametrize("stopping", [Stopping(iterations=9), Stopping(1.0, iterations=9)])
def test_only_the_clock_ends_planning(stopping: Stopping) -> None:
    """Agents would plan past a limit they know nothing of; none is started."""
    with pytest.raises(ValueError, match="limit seconds, and no iterations"):
        spawn.run_agents(["left"], [], stopping=stopping, seed=0, command=("no such program",))
