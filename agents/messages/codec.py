"""Messages to bytes and back: msgpack with limits, sequences packed.

Wire form: one msgpack array `[kind, head, epoch, seq, *fields]`. Sequences are
differences from one to the next, in the narrowest integer that holds them,
deflated: the candidates of one distribution share long runs, which
deflate folds. `decode` is the only entry for bytes of others; whatever they
hold it returns a valid message or raises `MessageError`, in bounded memory.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from typing import Any

import msgpack
import numpy as np

from agents.messages.kinds import (
    MAX_HEADS,
    MAX_SEQUENCES,
    MAX_SYMBOLS,
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
    Plans,
    Proposal,
    Sequence32,
    Stage,
    Stamp,
)

MAX_MESSAGE_BYTES = 256 * 1024
"""Nothing larger is sent or unpacked; zenoh drops it even earlier."""

MAX_JOINT_BYTES = 128 * 1024
"""Of a joint plan told while planning: it is said often and binds nobody.

A stated order of 40 000 contours and 8 heads fits, in no order at all."""

_WIDTHS = ("<i1", "<i2", "<i4", "<i8")
_DEFLATE_LEVEL = 6

KINDS: dict[type[Message], str] = {
    Hello: "hello",
    Distribution: "distribution",
    Joint: "joint",
    Proposal: "proposal",
    Commit: "commit",
    PlanRequest: "request",
    PlanReply: "reply",
    Beat: "beat",
    Goodbye: "goodbye",
}
_LIMITS = {"joint": MAX_JOINT_BYTES}  # the others: MAX_MESSAGE_BYTES


def kind_of(message: Message) -> str:
    """Return the word that names a message's kind on the wire and in keys."""
    return KINDS[type(message)]


def encode(envelope: Envelope) -> bytes:
    """Return the bytes of a message.

    Raises
    ------
    MessageError
        If they would exceed `MAX_MESSAGE_BYTES`, or a joint plan `MAX_JOINT_BYTES`.
    """
    stamp, message = envelope.stamp, envelope.message
    head = [kind_of(message), stamp.head, stamp.epoch, stamp.seq]
    packed: bytes = msgpack.packb(head + _fields(message), use_bin_type=True)
    _require_size(kind_of(message), len(packed))
    return packed


def decode(data: bytes, most_symbols: int = MAX_SYMBOLS) -> Envelope:
    """Return the message in `data`.

    Sequences are unpacked only if they have no more symbols than `most_symbols` in all: what
    a message of this problem may hold. A few bytes can stand for millions.

    Raises
    ------
    MessageError
        If `data` is too large, no msgpack, or not of the schema.
    """
    if len(data) > MAX_MESSAGE_BYTES:
        raise MessageError(f"{len(data)} bytes, limit {MAX_MESSAGE_BYTES}")
    try:
        items = _unpack(data)
        kind, head, epoch, seq, *fields = items
        reader = _READERS[_text(kind)]
        _require_size(kind, len(data))
        stamp = Stamp(_integer(head), _integer(epoch), _integer(seq))
        return Envelope(stamp, reader(fields, min(most_symbols, MAX_SYMBOLS)))
    except MessageError:
        raise
    except (ValueError, KeyError, TypeError, OverflowError, zlib.error, RecursionError) as error:
        raise MessageError(f"{type(error).__name__}: {str(error)[:120]}") from error


def _require_size(kind: str, size: int) -> None:
    limit = _LIMITS.get(kind, MAX_MESSAGE_BYTES)
    if size > limit:
        raise MessageError(f"{kind} of {size} bytes, limit {limit}")


def _unpack(data: bytes) -> list[Any]:
    # msgpack's limits bound what hostile headers can make it allocate: without
    # them five bytes announce an array of 2^32 items.
    unpacker = msgpack.Unpacker(
        raw=False,
        use_list=True,
        strict_map_key=True,
        max_buffer_size=MAX_MESSAGE_BYTES,
        max_str_len=1024,
        max_bin_len=MAX_MESSAGE_BYTES,
        max_array_len=4 * MAX_SEQUENCES,
        max_map_len=0,
        max_ext_len=0,
    )
    unpacker.feed(data)
    try:
        items = unpacker.unpack()
    except msgpack.UnpackException as error:
        raise MessageError(f"no msgpack: {type(error).__name__}") from error
    if not isinstance(items, list) or unpacker.tell() != len(data):
        raise MessageError("not one msgpack array")
    return items


def pack_sequences(sequences: Sequence[Sequence32]) -> list[Any]:
    """Return `[lengths, width, deflated differences]` of some sequences."""
    lengths = [len(s) for s in sequences]
    parts = [np.diff(s.astype(np.int64), prepend=np.int64(0)) for s in sequences]
    flat = np.concatenate([np.zeros(0, np.int64), *parts]).astype(np.int64)
    width = _narrowest(flat)
    return [lengths, width, zlib.compress(flat.astype(_WIDTHS[width]).tobytes(), _DEFLATE_LEVEL)]


def unpack_sequences(packed: object, most: int = MAX_SYMBOLS) -> tuple[Sequence32, ...]:
    """Return what `pack_sequences` packed, if that is `most` symbols; raises MessageError."""
    lengths, width, body = _list(packed, 3)
    sizes = [_integer(n) for n in _list(lengths)]
    dtype = _WIDTHS[_below(width, len(_WIDTHS))]
    if any(n < 0 for n in sizes) or sum(sizes) > most:
        raise MessageError(f"sequences of {sum(sizes)} symbols, limit {most}")
    flat = np.frombuffer(_inflate(body, sum(sizes) * int(dtype[-1])), dtype).astype(np.int64)
    return tuple(_undelta(part) for part in np.split(flat, np.cumsum(sizes)[:-1])[: len(sizes)])


def _undelta(deltas: np.ndarray[Any, np.dtype[np.int64]]) -> Sequence32:
    values = np.cumsum(deltas)
    if len(values) and not (values.min() >= -(2**31) and values.max() < 2**31):
        raise MessageError("a symbol of a sequence is no int32")
    return values.astype(np.int32)


def _inflate(body: object, size: int) -> bytes:
    # The stated size is the ceiling: a deflate bomb stops there.
    if not isinstance(body, bytes):
        raise MessageError(f"sequences are {type(body).__name__}, not bytes")
    inflater = zlib.decompressobj()
    flat = inflater.decompress(body, size + 1)
    if len(flat) != size or not inflater.eof or inflater.unused_data:
        raise MessageError(f"sequences inflate to other than {size} bytes")
    return flat


def _narrowest(flat: np.ndarray[Any, np.dtype[np.int64]]) -> int:
    peak = int(np.abs(flat).max()) if len(flat) else 0
    return next(w for w in range(4) if peak < 2 ** (8 * 2**w - 1))


def _fields(message: Message) -> list[Any]:
    match message:
        case Hello():
            return [message.problem, message.version, message.name, message.wants_answer]
        case Distribution():
            q = message.probabilities.astype("<f4").tobytes()
            return [pack_sequences(message.sequences), q]
        case Joint():
            return [list(message.live), *_plan_fields(message.plans), message.makespan_s]
        case Beat():
            return [message.within]
        case Proposal():
            return _proposal_fields(message)
        case Commit():
            stage, heard = int(message.stage), list(message.heard)
            return [list(message.live), message.digest, stage, message.term, heard]
        case PlanRequest():
            return [message.target, list(message.live), message.digest]
        case PlanReply():
            return [message.target, _proposal_fields(message.proposal)]
        case Goodbye():
            return [message.digest, message.reason]


def _proposal_fields(proposal: Proposal) -> list[Any]:
    said = [proposal.makespan_s, proposal.digest, proposal.serial]
    return [list(proposal.live), *_plan_fields(proposal.plans), *said]


def _plan_fields(plans: Plans) -> list[Any]:
    heads = sorted(plans)
    return [heads, pack_sequences([plans[h] for h in heads])]


def _read_hello(fields: list[Any], _: int) -> Hello:
    problem, version, name, wants_answer = _list(fields, 4)
    return Hello(_text(problem), _integer(version), _text(name), _bool(wants_answer))


def _read_distribution(fields: list[Any], most: int) -> Distribution:
    packed, q = _list(fields, 2)
    if not isinstance(q, bytes) or len(q) % 4 or not 0 < len(q) <= 4 * MAX_SEQUENCES:
        raise MessageError("probabilities are no float32 row")
    # Checked in single precision as it came; normalised again in double.
    row = np.frombuffer(q, "<f4").astype(np.float64)
    message = Distribution(unpack_sequences(packed, most), row)
    return Distribution(message.sequences, row / row.sum())


def _read_proposal(fields: list[Any], most: int) -> Proposal:
    live, heads, packed, makespan, digest, serial = _list(fields, 6)
    plans = _read_plans(heads, packed, most)
    return Proposal(_live(live), plans, _seconds(makespan), _text(digest), _bool(serial))


def _read_joint(fields: list[Any], most: int) -> Joint:
    live, heads, packed, makespan = _list(fields, 4)
    return Joint(_live(live), _read_plans(heads, packed, most), _seconds(makespan))


def _read_plans(heads: object, packed: object, most: int) -> Plans:
    owners = [_below(h, MAX_HEADS) for h in _list(heads)]
    sequences = unpack_sequences(packed, most)
    if len(set(owners)) != len(owners) or len(owners) != len(sequences):
        raise MessageError("plans and their heads do not match")
    return dict(zip(owners, sequences, strict=True))


def _read_beat(fields: list[Any], _: int) -> Beat:
    (within,) = _list(fields, 1)
    return Beat(_integer(within))


def _read_commit(fields: list[Any], _: int) -> Commit:
    live, digest, stage, term, heard = _list(fields, 5)
    terms = tuple(_integer(t) for t in _list(heard))
    return Commit(_live(live), _text(digest), Stage(_integer(stage)), _integer(term), terms)


def _read_request(fields: list[Any], _: int) -> PlanRequest:
    target, live, digest = _list(fields, 3)
    return PlanRequest(_integer(target), _live(live), _text(digest))


def _read_reply(fields: list[Any], most: int) -> PlanReply:
    target, proposal = _list(fields, 2)
    return PlanReply(_integer(target), _read_proposal(_list(proposal), most))


def _read_goodbye(fields: list[Any], _: int) -> Goodbye:
    digest, reason = _list(fields, 2)
    return Goodbye(_text(digest), _text(reason))


_READERS: dict[str, Callable[[list[Any], int], Message]] = {
    "hello": _read_hello,
    "distribution": _read_distribution,
    "joint": _read_joint,
    "proposal": _read_proposal,
    "commit": _read_commit,
    "request": _read_request,
    "reply": _read_reply,
    "beat": _read_beat,
    "goodbye": _read_goodbye,
}


def _list(value: object, length: int | None = None) -> list[Any]:
    if not isinstance(value, list) or (length is not None and len(value) != length):
        raise MessageError(f"expected an array of {length if length is not None else 'items'}")
    return value


def _integer(value: object) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise MessageError(f"expected an integer, got {type(value).__name__}")
    return value


def _bool(value: object) -> bool:
    if not isinstance(value, bool):
        raise MessageError(f"expected true or false, got {type(value).__name__}")
    return value


def _seconds(value: object) -> float:
    if not isinstance(value, float):
        raise MessageError(f"expected seconds as a float, got {type(value).__name__}")
    return value


def _below(value: object, limit: int) -> int:
    number = _integer(value)
    if not 0 <= number < limit:
        raise MessageError(f"{number} outside 0..{limit - 1}")
    return number


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise MessageError(f"expected text, got {type(value).__name__}")
    return value


def _live(value: object) -> tuple[int, ...]:
    return tuple(_integer(head) for head in _list(value))
