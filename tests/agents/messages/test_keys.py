"""Keys are built and parsed in one place, and strangers' keys are refused."""

from __future__ import annotations

import pytest

from agents.messages.keys import Keys
from agents.messages.kinds import MessageError
from agents.messages.seal import ForgedError
from tests.agents.sealed import OTHER, SEAL

KEYS = Keys(SEAL)
ROOT = f"decmcts/v3/{SEAL.session}"


def test_keys_come_back() -> None:
    """The head in the key is what a message is checked against."""
    assert KEYS.message(3, "commit") == f"{ROOT}/3/msg/commit"
    assert KEYS.parse_message(KEYS.message(3, "commit")) == (3, "commit")
    assert KEYS.parse_alive(KEYS.alive(3, 17)) == (3, 17)


@pytest.mark.parametrize(("head", "epoch"), [(3, 18), (2, 17), (3, 2**62)])
def test_a_token_of_who_lacks_the_secret_is_forged(head: int, epoch: int) -> None:
    """One of a huge epoch made all agents deaf to the real head."""
    seal = KEYS.alive(3, 17).rpartition("/")[2]
    for wrong in (seal, OTHER.of_token(head, epoch), "ab", "\u00e9" * 32):
        with pytest.raises(ForgedError):
            KEYS.parse_alive(f"{ROOT}/{head}/alive/{epoch}/{wrong}")


@pytest.mark.parametrize(
    "key",
    [
        f"{ROOT}/64/msg/commit",
        f"{ROOT}/-1/msg/commit",
        f"{ROOT}/01/msg/commit",
        "decmcts/v3/a2/1/msg/commit",
        f"{ROOT}/1/msg",
        f"{ROOT}/1/msg/a/b",
        f"{ROOT}/1/alive/5/ab",
        "",
    ],
)
def test_other_message_keys_are_refused(key: str) -> None:
    """Whatever else is on the bus is not ours."""
    with pytest.raises(MessageError):
        KEYS.parse_message(key)


@pytest.mark.parametrize(
    "key", [f"{ROOT}/1/alive/x/ab", f"{ROOT}/1/alive/5", f"{ROOT}/1/msg/commit"]
)
def test_other_liveliness_keys_are_refused(key: str) -> None:
    """A token without an incarnation can not be told from an old one."""
    with pytest.raises(MessageError):
        KEYS.parse_alive(key)
