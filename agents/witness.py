"""The witness: a process that hears for the launcher which heads still speak on the bus.

Two agents that do not hear one another both say so, and neither knows whose bus is lost. The
launcher has no bus of its own (zenoh's threads would be in its process); it starts a witness only
when it has to know. The witness joins the mesh at one more place, listens for some seconds, says
whom it heard, and ends:

    {"event": "heard", "heads": [0]}
"""

from __future__ import annotations

import signal
import time

from agents.launching.processes import failed
from agents.loop.pipes import PipeFront, any_command
from agents.networks.transport import Packet
from agents.networks.zenoh_transport import ZenohTransport
from agents.running.report import KIND
from decmcts.leaving import leave

LISTENS_S = 3.0  # links take up to 1 s; agents speak several times a second
POLL_S = 0.05


def heard_of(transport: ZenohTransport, heads: int, seconds: float) -> list[int]:
    """Return which of so many heads speak within some seconds; sooner if all do."""
    heard, until = set[int](), time.monotonic() + seconds
    while len(heard) < heads and time.monotonic() < until:
        packets = (a for a in transport.receive(POLL_S) if isinstance(a, Packet))
        heard.update(packet.head for packet in packets if packet.head < heads)
    return sorted(heard)


def main() -> int:
    """Listen, say whom it heard, and return the exit code."""
    front = PipeFront(parse=any_command)
    front.watch()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        words = front.arguments()
        if words is None or front.meeting is None:
            return 0
        (heads, epoch), meeting = map(int, words), front.meeting  # heads that could speak
        with ZenohTransport(meeting.seal, heads, epoch, meeting.places, kinds=(KIND,)) as bus:
            front.ready("")
            front.write({"event": "heard", "heads": heard_of(bus, heads, LISTENS_S)})
    except Exception as error:
        return failed(error)
    return 0


if __name__ == "__main__":
    leave(main())
