"""Ports for agents: free, different, and none that an outgoing connection may be given."""

from __future__ import annotations

import socket

import pytest

from agents.launching import spawn


def test_ports_are_different_and_can_be_listened_on() -> None:
    ports = spawn.free_ports(64)
    assert len(set(ports)) == 64
    assert set(ports) <= set(spawn.PORTS)
    for port in ports:
        with socket.create_server(("127.0.0.1", port)):
            pass


def test_outgoing_connections_get_other_ports() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        for _ in range(50):
            with socket.create_connection(server.getsockname()) as client:
                assert client.getsockname()[1] not in spawn.PORTS


def test_a_port_in_use_is_not_offered() -> None:
    with socket.create_server(("127.0.0.1", spawn.free_ports(1)[0])) as server:
        taken = server.getsockname()[1]
        with pytest.raises(OSError, match="no 1 free ports"):
            spawn.free_ports(1, range(taken, taken + 1))
