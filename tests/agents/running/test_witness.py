"""The witness hears which heads still speak: real zenoh sessions."""

from __future__ import annotations

import queue
import threading

import pytest

from agents.launching.places import free_ports
from agents.launching.processes import AgentLine
from agents.networks.meeting import Meeting
from agents.networks.zenoh_transport import ZenohTransport
from agents.running.report import KIND
from agents.running.witnessing import WITNESS, WitnessProcess

pytestmark = pytest.mark.slow
SECRET = bytes(range(32))


@pytest.mark.parametrize("speaking", [(0,), (1,), (0, 1), ()])
def test_a_witness_tells_who_speaks(speaking: tuple[int, ...]) -> None:
    """Heads that have no session, or keep silent, are not heard; it can be asked again."""
    places = tuple(f"tcp/127.0.0.1:{port}" for port in free_ports(3))
    heard: queue.Queue[AgentLine] = queue.Queue()
    witness = WitnessProcess(Meeting(places, SECRET), 1, heard.put)
    over, seal = threading.Event(), Meeting(places, SECRET).seal

    def speak(head: int) -> None:
        with ZenohTransport(seal, head, 1, places[:2], kinds=(KIND,)) as transport:
            while not over.wait(0.1):
                transport.send(KIND, b"here", reliable=False)

    threads = [threading.Thread(target=speak, args=(head,)) for head in speaking]
    for thread in threads:
        thread.start()
    try:
        for _ in range(2):
            witness.ask()
            while witness.is_listening:
                item = heard.get(timeout=30.0)
                assert item.head == WITNESS
                witness.take(item)
            assert witness.heard == speaking
    finally:
        over.set()
        witness.end()
        for thread in threads:
            thread.join()
