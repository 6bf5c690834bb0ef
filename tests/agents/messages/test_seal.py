"""Seals: who lacks the secret says nothing that is heard."""

from __future__ import annotations

import numpy as np
import pytest

from agents.messages.codec import encode
from agents.messages.kinds import Envelope, Goodbye, MessageError
from agents.messages.seal import SEAL_BYTES, ForgedError, Seal
from tests.agents.sealed import OTHER, SEAL, SECRET

PAYLOAD = encode(Envelope(1, 7, 9, Goodbye("", "done")))


def test_a_sealed_message_comes_back() -> None:
    assert SEAL.open(SEAL.close(PAYLOAD)) == PAYLOAD
    assert Seal.of(SECRET).open(SEAL.close(PAYLOAD)) == PAYLOAD
    assert len(SEAL.close(PAYLOAD)) == len(PAYLOAD) + SEAL_BYTES


def test_300_messages_that_were_tampered_with_are_forged() -> None:
    """A bit flipped, bytes cut or added, another team's seal: all are seen before unpacking."""
    rng, sealed = np.random.default_rng(42), SEAL.close(PAYLOAD)
    for trial in range(300):
        changed = bytearray(sealed)
        at = int(rng.integers(len(changed)))
        match trial % 4:
            case 0:
                changed[at] ^= 1 << int(rng.integers(8))
            case 1:
                del changed[at:]
            case 2:
                changed[at:at] = rng.bytes(int(rng.integers(1, 9)))
            case _:
                changed = bytearray(OTHER.close(rng.bytes(at)))
        with pytest.raises(ForgedError):
            SEAL.open(bytes(changed))


def test_a_token_s_seal_seals_no_message() -> None:
    """Else what is read in one key would open another door."""
    token = bytes.fromhex(SEAL.of_token(1, 7))
    with pytest.raises(ForgedError):
        SEAL.open(token + b"1/7")


def test_a_secret_shows_nowhere() -> None:
    """What is printed, or stands in a key, is no way to the rest."""
    assert repr(SEAL) == f"Seal(session={SEAL.session!r})"
    assert SEAL.password not in repr(SEAL) and SECRET.hex() not in repr(SEAL)
    assert len({SEAL.session, SEAL.password, OTHER.session, OTHER.password}) == 4


def test_a_short_secret_is_refused() -> None:
    """All of them could be tried."""
    with pytest.raises(MessageError, match="a secret of 15 bytes, least 16"):
        Seal.of(bytes(15))
