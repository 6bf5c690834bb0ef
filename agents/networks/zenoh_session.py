"""How a zenoh session of an agent is set up: every insecure default is closed here.

Agents are peers with explicit places in a full mesh, because peers do not relay. Nothing
is discovered, nothing listens anywhere else, and no link opens without the password that
follows from the team's secret.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

import zenoh

from agents.messages.codec import MAX_MESSAGE_BYTES
from agents.messages.seal import SEAL_BYTES, Seal
from agents.networks.meeting import TCP
from decmcts.errors import InputError

LEASE_MS = 1000  # a peer silent for so long is gone; zenoh's default is 10 s
USER = "decmcts"


def settings(listen: str, connect: Sequence[str]) -> dict[str, object]:
    """Return the zenoh settings of an agent at a place, and of its peers', but for its password."""
    return {
        "mode": "peer",
        "listen/endpoints": [listen],  # default: all interfaces
        "connect/endpoints": list(connect),
        # Peers may start later: keep trying, in the background. With a timeout
        # of 0 zenoh tries once and never again.
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 2},
        # A stopped process still accepts TCP: give its handshake up after a lease
        # too (default 10 s), or closing waits for it.
        "transport/unicast/open_timeout": LEASE_MS,
        "transport/unicast/accept_timeout": LEASE_MS,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/protocols": [listen.partition("/")[0]],
        # default: 1 GiB
        "transport/link/rx/max_message_size": MAX_MESSAGE_BYTES + SEAL_BYTES + 4096,
        "transport/link/tx/lease": LEASE_MS,
        # A blocked put to a hung peer gives it up after this; default: 5 s, in
        # which nothing reliable would reach the other peers either.
        "transport/link/tx/queue/congestion_control/block/wait_before_close": LEASE_MS * 1000,
        "transport/shared_memory/enabled": False,  # loses promoted queries under load
    }


@contextmanager
def configured(listen: str, connect: Sequence[str], seal: Seal) -> Iterator[zenoh.Config]:
    """Yield the configuration of an agent; the file it names is there in the `with` only."""
    with _dictionary(seal) as file:
        known = settings(listen, connect) | {
            "transport/auth/usrpwd/user": USER,
            "transport/auth/usrpwd/password": seal.password,
            "transport/auth/usrpwd/dictionary_file": file,
        }
        config = zenoh.Config()
        for key, value in known.items():
            config.insert_json5(key, json.dumps(value))
        yield config


def open_session(places: Sequence[str], head: int, seal: Seal) -> zenoh.Session:
    """Open the session of one head of a full mesh, with a place for each.

    InputError if nobody can listen there: in the words of this program, not of zenoh.
    """
    connect = [place for other, place in enumerate(places) if other != head]
    try:
        with configured(places[head], connect, seal) as config:
            return zenoh.open(config)
    except (zenoh.ZError, OSError) as error:
        where = places[head].partition("/")[2]
        what = "address" if places[head].startswith(TCP) else "socket"
        raise InputError(
            f"cannot listen at the {what} {where}",
            advice="another process may have it: name another one to all agents",
        ) from error


@contextmanager
def _dictionary(seal: Seal) -> Iterator[str]:
    """Yield the name of a file with the password, which zenoh reads as it opens a session."""
    line = f"{USER}:{seal.password}\n".encode()
    if hasattr(os, "memfd_create"):  # in no folder: nobody else opens it, nothing is left
        descriptor, name = os.memfd_create("decmcts"), ""
    else:
        descriptor, name = tempfile.mkstemp(prefix="decmcts-")
    try:
        os.write(descriptor, line)
        yield name or f"/proc/self/fd/{descriptor}"
    finally:
        os.close(descriptor)
        if name:
            with suppress(OSError):
                os.unlink(name)
