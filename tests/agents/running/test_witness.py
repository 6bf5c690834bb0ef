"""The witness hears which heads still speak: real zenoh sessions."""

from __future__ import annotations

import sys
import threading
import time
from pathlib import Path

import pytest

from agents.launching.places import free_ports
from agents.networks.meeting import Meeting
from agents.networks.zenoh_transport import ZenohTransport
from agents.running import heads
from agents.running.heads import WitnessProcess
from agents.running.report import KIND

pytestmark = pytest.mark.slow
SECRET = bytes(range(32))
HANGS_ONCE = """
import json, pathlib, sys, time
mark = pathlib.Path({mark!r})
is_first = not mark.exists()
mark.touch()
sys.stdin.readline()
time.sleep(60.0 if is_first else 0.5)
print(json.dumps({{"event": "heard", "heads": [0, 1]}}), flush=True)
"""


def wait_for(witness: WitnessProcess) -> None:
    """Wait until it has said what it heard, or is given up."""
    while witness.is_listening:
        time.sleep(0.02)


@pytest.mark.parametrize("speaking", [(1,), (0, 1), ()])
def test_a_witness_tells_who_speaks(speaking: tuple[int, ...]) -> None:
    """Heads that have no session, or keep silent, are not heard; it can be asked again."""
    places = tuple(f"tcp/127.0.0.1:{port}" for port in free_ports(3))
    witness = WitnessProcess(Meeting(places, SECRET), 1)
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
            wait_for(witness)
            assert witness.heard == speaking
    finally:
        over.set()
        witness.end()
        for thread in threads:
            thread.join()


def test_the_late_end_of_a_witness_that_hung_ends_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next one is heard out. It had ended unheard, and a head that works was stopped."""
    asked = tmp_path / "asked"
    script = HANGS_ONCE.format(mark=str(asked))
    monkeypatch.setattr(heads, "COMMAND", (sys.executable, "-c", script))
    monkeypatch.setattr(heads, "MOST_S", 0.5)
    witness = WitnessProcess(Meeting(("a", "b", "c"), SECRET), 1)
    witness.ask()
    while not asked.exists():  # on a busy host it begins late
        time.sleep(0.02)
    wait_for(witness)
    assert witness.heard == ()
    monkeypatch.setattr(heads, "MOST_S", 20.0)
    witness.ask()
    wait_for(witness)
    witness.end()
    assert witness.heard == (0, 1)
