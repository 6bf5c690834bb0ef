"""Messages to bytes and back: msgpack with limits, sequences packed.

Wire form: one msgpack array `[kind, head, epoch, seq, *fields]`, where fields are those of
`agents.messages.kinds` in their order, each read by its type (`agents.messages.rows`).
Sequences are differences from one to the next, in the narrowest integer that holds them,
deflated: the candidates of one distribution share long runs, which
deflate folds. `decode` is the only entry for bytes of others; whatever they
hold it returns a valid message or raises `MessageError`, in bounded memory.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import Any, TypeVar

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
    check_head,
)
from agents.messages.rows import PLAIN, array, fields_of, integer, text, unpacker
from decmcts.arrays import Floats

MAX_MESSAGE_BYTES = 256 * 1024  # nothing larger is sent or unpacked; zenoh drops it even earlier

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
_MESSAGES = {word: kind for kind, word in KINDS.items()}
_SEQUENCES, _PROBABILITIES = tuple[Sequence32, ...], Floats
M = TypeVar("M")


def kind_of(message: Message) -> str:
    """Return the word that names a message's kind on the wire and in keys."""
    return KINDS[type(message)]


def encode(envelope: Envelope) -> bytes:
    """Return the bytes of a message; MessageError if they are more than its kind may have."""
    kind = kind_of(envelope.message)
    head = [kind, envelope.head, envelope.epoch, envelope.seq]
    packed: bytes = msgpack.packb(head + _row(envelope.message), use_bin_type=True)
    _require_size(kind, len(packed))
    return packed


def decode(data: bytes, most_symbols: int = MAX_SYMBOLS) -> Envelope:
    """Return the message in `data`; MessageError if that is too large or not of the schema.

    Sequences are unpacked only if they have no more symbols than `most_symbols` in all: what
    a message of this problem may hold. A few bytes can stand for millions.
    """
    if len(data) > MAX_MESSAGE_BYTES:
        raise MessageError(f"{len(data)} bytes, limit {MAX_MESSAGE_BYTES}")
    try:
        word, head, epoch, seq, *fields = _unpack(data)
        kind = _MESSAGES[text(word)]
        _require_size(word, len(data))
        head, epoch, seq = integer(head), integer(epoch), integer(seq)
        check_head(head)  # before anything is unpacked
        return Envelope(head, epoch, seq, _read(kind, fields, min(most_symbols, MAX_SYMBOLS)))
    except MessageError:
        raise
    except (ValueError, KeyError, TypeError, OverflowError, zlib.error, RecursionError) as error:
        raise MessageError(f"{type(error).__name__}: {str(error)[:120]}") from error


def _require_size(kind: str, size: int) -> None:
    limit = _LIMITS.get(kind, MAX_MESSAGE_BYTES)
    if size > limit:
        raise MessageError(f"{kind} of {size} bytes, limit {limit}")


def _unpack(data: bytes) -> list[Any]:
    most = MAX_MESSAGE_BYTES
    reader = unpacker(most, items=4 * MAX_SEQUENCES, text=1024, binary=most)
    reader.feed(data)
    try:
        items = reader.unpack()
    except msgpack.UnpackException as error:
        raise MessageError(f"no msgpack: {type(error).__name__}") from error
    if not isinstance(items, list) or reader.tell() != len(data):
        raise MessageError("not one msgpack array")
    return items


def pack_sequences(sequences: Sequence[Sequence32]) -> list[Any]:
    """Return `[lengths, width, deflated differences]` of some sequences."""
    lengths = [len(s) for s in sequences]
    parts = [np.diff(s.astype(np.int64), prepend=np.int64(0)) for s in sequences]
    flat = np.concatenate([np.zeros(0, np.int64), *parts]).astype(np.int64)
    peak = int(np.abs(flat).max()) if len(flat) else 0
    width = next(w for w in range(4) if peak < 2 ** (8 * 2**w - 1))  # the narrowest that holds it
    return [lengths, width, zlib.compress(flat.astype(_WIDTHS[width]).tobytes(), _DEFLATE_LEVEL)]


def unpack_sequences(packed: object, most: int = MAX_SYMBOLS) -> tuple[Sequence32, ...]:
    """Return what `pack_sequences` packed, if that is `most` symbols; raises MessageError."""
    lengths, width, body = array(packed, 3)
    sizes = [integer(n) for n in array(lengths)]
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


def _row(message: Message) -> list[Any]:
    """Return the fields of a message as they travel; plans are two items, all else is one."""
    row: list[Any] = []
    for name, kind in fields_of(type(message)).items():
        value = getattr(message, name)
        if kind == Plans:
            heads = sorted(value)
            row += [heads, pack_sequences([value[h] for h in heads])]
        elif kind == _SEQUENCES:
            row.append(pack_sequences(value))
        elif kind == _PROBABILITIES:
            row.append(value.astype("<f4").tobytes())
        else:
            row.append(_row(value) if kind is Proposal else value)
    return row


def _read(kind: type[M], row: object, most: int) -> M:
    """Return the message whose fields a row holds, with `most` symbols of sequences in all."""
    kinds = list(fields_of(kind).values())
    items = iter(array(row, len(kinds) + kinds.count(Plans)))

    def field_of(kind: Any) -> Any:
        item = next(items)
        if kind == Plans:
            return _read_plans(item, next(items), most)
        if kind == _SEQUENCES:
            return unpack_sequences(item, most)
        if kind == _PROBABILITIES:
            return _read_probabilities(item)
        return _read(Proposal, item, most) if kind is Proposal else PLAIN[kind](item)

    return kind(*map(field_of, kinds))


def _read_probabilities(packed: object) -> Floats:
    if not isinstance(packed, bytes) or len(packed) % 4 or len(packed) > 4 * MAX_SEQUENCES:
        raise MessageError("probabilities are no float32 row")
    row = np.frombuffer(packed, "<f4").astype(np.float64)
    # Checked in single precision as it came; normalised again in double.
    if not np.isfinite(row).all() or abs(float(row.sum()) - 1.0) >= 1e-3:
        raise MessageError("probabilities do not sum to 1")
    return np.asarray(row / row.sum())


def _read_plans(heads: object, packed: object, most: int) -> Plans:
    owners = [_below(h, MAX_HEADS) for h in array(heads)]
    sequences = unpack_sequences(packed, most)
    if len(set(owners)) != len(owners) or len(owners) != len(sequences):
        raise MessageError("plans and their heads do not match")
    return dict(zip(owners, sequences, strict=True))


def _below(value: object, limit: int) -> int:
    number = integer(value)
    if not 0 <= number < limit:
        raise MessageError(f"{number} outside 0..{limit - 1}")
    return number
