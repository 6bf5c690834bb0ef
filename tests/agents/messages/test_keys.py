"""Keys are built and parsed in one place, and strangers' keys are refused."""

from __future__ import annotations

import pytest

from agents.messages.keys import Keys
from agents.messages.kinds import MessageError

KEYS = Keys("a1")


def test_keys_come_back() -> None:
    """The head in the key is what a message is checked against."""
    assert KEYS.message(3, "commit") == "decmcts/v2/a1/3/msg/commit"
    assert KEYS.parse_message(KEYS.message(3, "commit")) == (3, "commit")
    assert KEYS.parse_alive(KEYS.alive(3, 17)) == (3, 17)


@pytest.mark.parametrize("session", ["", "a/b", "*", "a b", "x" * 65, "$*"])
def test_a_session_that_would_widen_a_key_expression_is_refused(session: str) -> None:
    """A wildcard in the name would join strangers' sessions."""
    with pytest.raises(MessageError):
        Keys(session)


@pytest.mark.parametrize(
    "key",
    [
        "decmcts/v2/a1/64/msg/commit",
        "decmcts/v2/a1/-1/msg/commit",
        "decmcts/v2/a1/01/msg/commit",
        "decmcts/v2/a2/1/msg/commit",
        "decmcts/v2/a1/1/msg",
        "decmcts/v2/a1/1/msg/a/b",
        "decmcts/v2/a1/1/alive/5",
        "",
    ],
)
def test_other_message_keys_are_refused(key: str) -> None:
    """Whatever else is on the bus is not ours."""
    with pytest.raises(MessageError):
        KEYS.parse_message(key)


@pytest.mark.parametrize("key", ["decmcts/v2/a1/1/alive/x", "decmcts/v2/a1/1/msg/commit"])
def test_other_liveliness_keys_are_refused(key: str) -> None:
    """A token without an incarnation can not be told from an old one."""
    with pytest.raises(MessageError):
        KEYS.parse_alive(key)
