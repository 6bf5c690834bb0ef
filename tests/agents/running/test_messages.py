"""Reports, the port and the clock: what goes in comes out, and nothing else gets in."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from agents.messages.event_stream import pack_event
from agents.networks.memory import LossyTransport, MemoryNetwork, MemoryTransport, Weather
from agents.networks.transport import Packet
from agents.running.clock import PrintClock
from agents.running.port import (
    Abort,
    Alive,
    Finish,
    Pause,
    Pipe,
    Ready,
    ReleaseActions,
    Resume,
    Start,
    pack,
)
from agents.running.report import HeadReport, Reached, newer, unpack_report
from decmcts.print.print_events import EventKind, PrintEvent

EVENT = PrintEvent(EventKind.PASSED, 1, 12.5, 3, 2, (1.0, 2.0, 3.0))
REPORT = HeadReport(1, 7, 2, "0" * 32, Reached(3, True, 2), EVENT)


def test_a_report_comes_back() -> None:
    """With the last event of its controller."""
    assert unpack_report(1, REPORT.pack()) == REPORT
    with pytest.raises(ValueError):
        unpack_report(0, REPORT.pack())


@pytest.mark.parametrize("seed", range(200))
def test_broken_reports_are_refused_by_name(seed: int) -> None:
    """Whatever bytes hold: a report or ValueError."""
    rng = np.random.default_rng(seed)
    content = bytearray(REPORT.pack())
    for place in rng.integers(len(content), size=3).tolist():
        content[place] = int(rng.integers(256))
    try:
        found = unpack_report(1, bytes(content[: int(rng.integers(1, len(content) + 1))]))
    except ValueError:
        return
    assert found.head == 1


def test_a_report_that_is_overtaken_changes_nothing() -> None:
    """The newest counts, and in one plan no head goes back."""
    late = HeadReport(1, 6, 2, "0" * 32, Reached(1), EVENT)
    assert newer(REPORT, late) is REPORT
    lost = HeadReport(1, 9, 2, "0" * 32, Reached(2), EVENT)
    assert newer(REPORT, lost).reached == REPORT.reached
    following = HeadReport(1, 10, 3, "1" * 32, Reached(0))
    assert newer(REPORT, following) == following


def test_what_the_port_carries_comes_back() -> None:
    """Commands one way; events, `ready` and `alive` the other."""
    commands = [
        Start(0, "plan", "ab"),
        ReleaseActions(0, 4),
        Pause(),
        Resume(),
        Abort(),
        Finish("gone"),
    ]
    said = [Ready(0, "ab"), Alive(1.5, (1.0, 2.0, 3.0)), EVENT]
    for packed, name, due in (
        ([pack(each) for each in commands], "commands", commands),
        ([pack(said[0]), pack(said[1]), pack_event(EVENT)], "statements", said),
    ):
        reads, writes = os.pipe()
        os.write(writes, b"".join(packed))
        os.close(writes)
        pipe = Pipe(reads)
        assert list(getattr(pipe, name)()) == due
        assert list(getattr(pipe, name)()) == [] and not pipe.open
        os.close(reads)


def test_what_is_no_message_ends_a_pipe() -> None:
    """As if whoever speaks had gone: it is not believed any more."""
    reads, writes = os.pipe()
    os.write(writes, b"\x93\xa3bad\x01\x02")
    pipe = Pipe(reads)
    assert list(pipe.statements()) == [] and not pipe.open
    for descriptor in (reads, writes):
        os.close(descriptor)


def test_the_clock_goes_on_when_its_pace_changes(tmp_path: Path) -> None:
    """No process sees it jump."""
    clock = PrintClock.made(tmp_path / "clock", 1000.0)
    other = PrintClock(tmp_path / "clock")
    began = time.monotonic()
    while other.now() < 20.0:
        assert time.monotonic() - began < 10.0
    before = other.now()
    clock.set_pace(0.001)
    assert before <= other.now() <= clock.now() + 0.01
    assert other.pace == 0.001 and other.until(other.now() + 1.0) > 900.0
    assert other.until(0.0) == 0.0


class World:
    """The seconds of the world, and what happens once just before or behind a look at them."""

    def __init__(self) -> None:
        self.now = 0.0
        self.before: Callable[[], None] | None = None
        self.behind: Callable[[], None] | None = None

    def monotonic(self) -> float:
        """Return the seconds."""
        before, behind, self.before, self.behind = self.before, self.behind, None, None
        if before is not None:
            before()
        now = self.now
        if behind is not None:
            behind()
        return now


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    world = World()
    monkeypatch.setattr("agents.running.clock.time", world)
    return world


def test_no_process_sees_a_time_that_a_change_of_pace_takes_back(
    tmp_path: Path, world: World
) -> None:
    """Be the one that sets the pace held up, in which the others go on at the old one."""
    clock = PrintClock.made(tmp_path / "clock", 1000.0)
    other, seen = PrintClock(tmp_path / "clock"), list[float]()
    reader = Thread(target=lambda: seen.append(other.now()))

    def held_up() -> None:
        world.now = 15.0
        reader.start()
        reader.join(0.05)

    world.now, world.behind = 10.0, held_up
    clock.set_pace(1.0)
    reader.join()
    assert seen[0] <= clock.now()


def test_who_is_held_up_while_it_reads_the_clock_sees_the_new_pace(
    tmp_path: Path, world: World
) -> None:
    """The old one would count the seconds since then many times."""
    clock = PrintClock.made(tmp_path / "clock", 1000.0)
    other = PrintClock(tmp_path / "clock")
    world.now = 10.0

    def held_up() -> None:
        clock.set_pace(1.0)
        world.now = 15.0

    world.before = held_up
    assert other.now() <= clock.now()


def test_a_lossy_transport_loses_doubles_and_delays() -> None:
    """What the agents are tried with is as bad as it is said to be."""
    network = MemoryNetwork(np.random.default_rng(0))
    first = MemoryTransport(network, 0).__enter__()
    weather = Weather(loss=0.2, delay_s=(0.0, 0.02), duplicate=0.1)
    second = LossyTransport(MemoryTransport(network, 1), weather, np.random.default_rng(1))
    with second:
        for i in range(500):
            first.send("run", b"%d" % i, reliable=False)
        network.advance(1.0)
        found: list[bytes] = []
        until = time.monotonic() + 0.1
        while time.monotonic() < until:
            found += [a.payload for a in second.receive(0.0) if isinstance(a, Packet)]
    assert 350 < len(set(found)) < 450 and len(found) > len(set(found))
    assert found != sorted(found, key=int)
