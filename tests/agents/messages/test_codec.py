"""The codec returns what was sent, and nothing else, whatever the bytes."""

from __future__ import annotations

import zlib

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from agents.messages.codec import (
    MAX_JOINT_BYTES,
    MAX_MESSAGE_BYTES,
    decode,
    encode,
    kind_of,
    pack_sequences,
    unpack_sequences,
)
from agents.messages.kinds import (
    Beat,
    Commit,
    Distribution,
    Envelope,
    Goodbye,
    Hello,
    Joint,
    Message,
    MessageError,
    PlanReply,
    PlanRequest,
    Proposal,
    Stage,
)
from decmcts.team.engine.plans import MOST_SHIFT, MOST_STATED, StatedOrder, encode_stated
from decmcts.team.engine.plans import encode as encode_plan

DIGEST = "0123456789abcdef" * 2
PROPOSAL = Proposal((0, 1), {1: np.int32([4, 1, 2]), 0: np.int32([])}, 12.5, DIGEST)
DISTRIBUTION = Distribution((np.int32([3, 1, 2]), np.int32([1])), np.float64([0.25, 0.75]))
PLAIN: list[Message] = [
    Hello(DIGEST, 1, "left", True),
    Commit((0, 2), DIGEST, Stage.AGREED, 7, (0, 9)),
    PlanRequest(1, (0, 1), DIGEST),
    Beat(150),
    Goodbye("", "terminated"),
]
JOINT = Joint((0, 1), {1: np.int32([4, 1, 2]), 0: np.int32([])}, 12.5)
ALL = [*PLAIN, JOINT, PROPOSAL, DISTRIBUTION, PlanReply(1, PROPOSAL)]
sequences = arrays(np.int32, st.integers(0, 60), elements=st.integers(-(2**31), 2**31 - 1))


def wire(message: Message) -> bytes:
    return encode(Envelope(1, 5, 9, message))


@pytest.mark.parametrize("message", PLAIN, ids=kind_of)
def test_plain_messages_come_back_equal(message: Message) -> None:
    """What one agent says is what the other hears."""
    heard = decode(wire(message))
    assert heard == Envelope(1, 5, 9, message)


def test_a_proposal_comes_back_bit_for_bit() -> None:
    """Digests of resolved plans only agree if the plans do."""
    heard = decode(wire(PROPOSAL)).message
    assert isinstance(heard, Proposal)
    assert (heard.live, heard.makespan_s, heard.digest) == ((0, 1), 12.5, DIGEST)
    assert {h: s.tolist() for h, s in heard.plans.items()} == {0: [], 1: [4, 1, 2]}
    assert all(s.dtype == np.int32 for s in heard.plans.values())


def test_a_joint_plan_comes_back_bit_for_bit() -> None:
    """Who is told a plan must judge the one that was found."""
    heard = decode(wire(JOINT)).message
    assert isinstance(heard, Joint)
    assert (heard.live, heard.makespan_s) == ((0, 1), 12.5)
    assert {h: s.tolist() for h, s in heard.plans.items()} == {0: [], 1: [4, 1, 2]}


@pytest.mark.parametrize("serial", [True, False])
def test_a_proposal_says_whether_it_is_serial(serial: bool) -> None:
    """Serial orders are checked and win against all else."""
    heard = decode(wire(Proposal((0, 1), {0: np.int32([1])}, 1.0, DIGEST, serial))).message
    assert isinstance(heard, Proposal) and heard.serial is serial


def test_a_joint_plan_of_5000_contours_and_8_heads_fits_in_16_kib() -> None:
    """A symbol for each contour, in no order at all."""
    rng = np.random.default_rng(5)
    rows = np.array_split(rng.permutation(5000).astype(np.int32), 8)
    joint = Joint(tuple(range(8)), dict(enumerate(rows)), 1e5)
    data = wire(joint)
    assert len(data) <= 16 * 1024
    heard = decode(data).message
    assert isinstance(heard, Joint)
    assert all(np.array_equal(heard.plans[h], row) for h, row in enumerate(rows))


def test_plans_with_650_shifts_each_of_8_heads_fit_in_16_kib() -> None:
    """Any shifts a plan may have, in no order at all: nothing is longer but a stated order."""
    rng = np.random.default_rng(5)
    shifts = rng.integers(-MOST_SHIFT, MOST_SHIFT + 1, (8, 650)).astype(np.int32)
    plans = {head: encode_plan(3, 650, shifts[head]) for head in range(8)}
    data = wire(Joint(tuple(range(8)), plans, 1e5))
    assert len(data) <= 16 * 1024
    heard = decode(data).message
    assert isinstance(heard, Joint)
    assert all(np.array_equal(heard.plans[h], plan) for h, plan in plans.items())


def test_a_stated_order_of_5000_contours_and_8_heads_fits_in_16_kib() -> None:
    """In no order at all, each contour by any head: nothing is longer."""
    rng = np.random.default_rng(5)
    is_reversed, head = rng.random(5000) < 0.5, rng.integers(0, 8, 5000)
    plan = encode_stated(
        StatedOrder(rng.permutation(5000).astype(np.int32), is_reversed, head), 8, 9
    )
    nothing = np.empty(0, np.int32)
    plans = {h: plan if h == 3 else nothing for h in range(8)}
    data = wire(Joint(tuple(range(8)), plans, 1e5))
    assert len(data) <= 16 * 1024
    heard = decode(data).message
    assert isinstance(heard, Joint)
    assert np.array_equal(heard.plans[3], plan)


def test_a_stated_order_of_40000_contours_and_8_heads_fits_the_limit() -> None:
    """The largest prints' heads must be able to tell what they polished."""
    rng = np.random.default_rng(5)
    order = rng.permutation(40_000).astype(np.int32)
    stated = StatedOrder(order, rng.random(40_000) < 0.5, rng.integers(0, 8, 40_000))
    joint = Joint(tuple(range(8)), {1: encode_stated(stated, 8, 9)}, 1e5)
    assert len(wire(joint)) <= MAX_JOINT_BYTES


def test_what_planners_state_at_most_can_be_proposed() -> None:
    """Without it heads could not agree: a proposal that is too long is never sent."""
    rng = np.random.default_rng(5)
    order = rng.permutation(MOST_STATED).astype(np.int32)
    stated = StatedOrder(order, rng.random(MOST_STATED) < 0.5, rng.integers(0, 64, MOST_STATED))
    plans = {1: encode_stated(stated, 64, 9)}
    assert len(wire(Proposal(tuple(range(64)), plans, 1e5, DIGEST))) <= MAX_MESSAGE_BYTES


def test_a_joint_plan_above_its_limit_is_neither_sent_nor_read() -> None:
    """It is said often, and many of them must fit where one proposal does."""
    rng = np.random.default_rng(5)
    rows = {h: rng.permutation(12_000).astype(np.int32) for h in range(8)}
    with pytest.raises(MessageError, match=rf"joint of \d+ bytes, limit {MAX_JOINT_BYTES}"):
        wire(Joint(tuple(range(8)), rows, 1e5))
    proposal = bytearray(wire(Proposal(tuple(range(8)), rows, 1e5, DIGEST)))
    forged = proposal.replace(b"\xa8proposal", b"\xa5joint")
    with pytest.raises(MessageError, match=rf"joint of \d+ bytes, limit {MAX_JOINT_BYTES}"):
        decode(bytes(forged))


def test_a_distribution_comes_back_with_probabilities_that_sum_to_one() -> None:
    """They travel in single precision and are sampled from in double."""
    third = Distribution(DISTRIBUTION.sequences, np.float64([1 / 3, 2 / 3]))
    heard = decode(wire(third)).message
    assert isinstance(heard, Distribution)
    assert heard.probabilities == pytest.approx([1 / 3, 2 / 3], abs=1e-7)
    assert abs(heard.probabilities.sum() - 1.0) < 1e-15
    assert [s.tolist() for s in heard.sequences] == [[3, 1, 2], [1]]


@pytest.mark.slow
@settings(max_examples=50)
@given(st.lists(sequences, max_size=8))
def test_any_sequences_come_back(rows: list[np.ndarray]) -> None:
    """The compression loses nothing, over the whole range of int32."""
    back = unpack_sequences(pack_sequences(rows))
    assert [b.tolist() for b in back] == [r.tolist() for r in rows]


def test_candidates_that_share_runs_cost_little_more_than_one() -> None:
    """ "Compressed" is literal: ten like sequences must not cost ten times one."""
    rng = np.random.default_rng(1)
    base = rng.permutation(400).astype(np.int32)
    alike = []
    for _ in range(10):
        row = base.copy()
        i, j = sorted(rng.integers(0, 400, 2))
        row[i:j] = np.roll(row[i:j], 1)
        alike.append(row)
    one, ten = (len(pack_sequences(rows)[2]) for rows in (alike[:1], alike))
    assert ten < 2 * one
    assert ten < 10 * base.nbytes / 10


@settings(max_examples=300)
@given(st.binary(max_size=300))
def test_random_bytes_are_refused_and_nothing_else(data: bytes) -> None:
    """A stranger on the bus must not bring an agent down."""
    with pytest.raises(MessageError):
        decode(data)


@pytest.mark.slow
@settings(max_examples=200)
@given(st.sampled_from(ALL), st.data())
def test_a_changed_byte_gives_a_valid_message_or_a_refusal(
    message: Message, data: st.DataObject
) -> None:
    """Nearly right is the hardest kind of wrong."""
    raw = bytearray(wire(message))
    at = data.draw(st.integers(0, len(raw) - 1))
    raw[at] = data.draw(st.integers(0, 255))
    try:
        heard = decode(bytes(raw[: data.draw(st.sampled_from([len(raw), at]))]))
    except MessageError:
        return
    assert isinstance(heard, Envelope)


texts = st.sampled_from(["", "a", DIGEST, "x" * 300])
numbers = st.integers(-(2**63), 2**64 - 1) | st.integers(0, 3) | st.floats()
scalars = st.none() | st.booleans() | numbers | texts | st.binary(max_size=20)
values = scalars | st.lists(scalars | st.lists(scalars, max_size=3), max_size=4)


@pytest.mark.slow
@settings(max_examples=200)
@given(st.sampled_from(sorted(map(kind_of, ALL))), st.lists(values, max_size=8))
def test_well_formed_msgpack_of_the_wrong_shape_is_refused(kind: str, fields: list) -> None:
    """Right kind, wrong fields: the schema must hold by itself."""
    try:
        heard = decode(msgpack.packb([kind, 0, 1, 2, *fields]))
    except MessageError:
        return
    assert kind_of(heard.message) == kind


def hostile(name: str) -> bytes:
    packed = pack_sequences([np.int32([1, 2, 3])])
    bomb = zlib.compress(bytes(50_000_000))
    q = np.float32([1.0]).tobytes()
    made = {
        "array of 2^32 announced": b"\xdd\xff\xff\xff\xff",
        "map": msgpack.packb({"kind": "hello"}),
        "extension": msgpack.packb(msgpack.ExtType(1, b"x")),
        "nested 5000 deep": b"\x91" * 5000,
        "two messages": wire(PLAIN[0]) * 2,
        "too large": b"\x00" * (MAX_MESSAGE_BYTES + 1),
        "unknown kind": msgpack.packb(["sudo", 0, 1, 2]),
        "head 64": msgpack.packb(["goodbye", 64, 1, 2, "", ""]),
        "negative epoch": msgpack.packb(["goodbye", 0, -1, 2, "", ""]),
        "bool as head": msgpack.packb(["goodbye", True, 1, 2, "", ""]),
        "stage 4": msgpack.packb(["commit", 0, 1, 2, [0], DIGEST, 4, 1, [0]]),
        "heard of nobody": msgpack.packb(["commit", 0, 1, 2, [0], DIGEST, 1, 1, []]),
        "live not ascending": msgpack.packb(["request", 0, 1, 2, 0, [1, 0], DIGEST]),
        "digest no hex": msgpack.packb(["request", 0, 1, 2, 0, [1], "g" * 32]),
        "makespan NaN": msgpack.packb(["proposal", 0, 1, 2, [0], [0], packed, np.nan, DIGEST]),
        "plan twice": msgpack.packb(
            ["proposal", 0, 1, 2, [0], [0, 0], pack_sequences([np.int32([1])] * 2), 1.0, DIGEST]
        ),
        "deflate bomb": msgpack.packb(["distribution", 0, 1, 2, [[3], 0, bomb], q]),
        "2^40 symbols announced": msgpack.packb(
            ["distribution", 0, 1, 2, [[2**40], 0, packed[2]], q]
        ),
        "sum not one": msgpack.packb(
            ["distribution", 0, 1, 2, packed, np.float32([0.5]).tobytes()]
        ),
        "probability inf": msgpack.packb(
            ["distribution", 0, 1, 2, packed, np.float32([np.inf]).tobytes()]
        ),
        "no sequences": msgpack.packb(["distribution", 0, 1, 2, pack_sequences([]), b""]),
    }
    return made[name]


@pytest.mark.parametrize(
    "name",
    [
        "array of 2^32 announced",
        "map",
        "extension",
        "nested 5000 deep",
        "two messages",
        "too large",
        "unknown kind",
        "head 64",
        "negative epoch",
        "bool as head",
        "stage 4",
        "heard of nobody",
        "live not ascending",
        "digest no hex",
        "makespan NaN",
        "plan twice",
        "deflate bomb",
        "2^40 symbols announced",
        "sum not one",
        "probability inf",
        "no sequences",
    ],
)
def test_hostile_messages_are_refused(name: str) -> None:
    """Each is a way known to break readers of msgpack or of this schema."""
    with pytest.raises(MessageError):
        decode(hostile(name))


@pytest.mark.slow
def test_an_own_message_over_the_limit_is_not_made() -> None:
    """It would be dropped by every peer: say so at the sender."""
    noise = np.random.default_rng(0).integers(0, 2**31 - 1, 3_000_000, dtype=np.int32)
    with pytest.raises(MessageError, match="limit"):
        wire(Proposal((0,), {0: noise}, 1.0, DIGEST))


def test_entropy_says_how_undecided_a_head_is() -> None:
    """What the live table shows: 1 for plans all alike, 0 for one that is sure."""
    two = DISTRIBUTION.sequences
    assert Distribution(two, np.float64([0.5, 0.5])).entropy == pytest.approx(1.0)
    assert Distribution(two, np.float64([1.0, 0.0])).entropy == 0.0
    assert Distribution(two[:1], np.float64([1.0])).entropy == 0.0
