"""What the page's script does with its data, in Python: to look at what a report holds."""

from __future__ import annotations

import base64
import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np


def page_of(path: Path) -> dict[str, Any]:
    """Return the JSON of a report with its arrays."""
    text = path.read_text(encoding="utf-8")
    packed = re.search(r'<script type="text/plain" id="packed">([^<]*)</script>', text)
    assert packed is not None
    raw = zlib.decompress(base64.b64decode(packed[1]))
    size = int.from_bytes(raw[:4], "little")
    return with_arrays(json.loads(raw[4 : 4 + size]), raw[4 + size :])


def with_arrays(value: Any, raw: bytes) -> Any:
    """Return JSON with every place of an array as that array."""
    if isinstance(value, list):
        return [with_arrays(each, raw) for each in value]
    if not isinstance(value, dict):
        return value
    if {"at", "n", "type"} <= set(value):
        return array_at(value, raw)
    return {key: with_arrays(each, raw) for key, each in value.items()}


def array_at(place: dict[str, Any], raw: bytes) -> np.ndarray:
    n, width = place["n"], int(place["type"][1:]) // 8
    by_weight = np.frombuffer(raw, np.uint8, n * width, place["at"]).reshape(width, n)
    whole = np.ascontiguousarray(by_weight.T).view(f"<i{width}").ravel().astype(np.int64)
    return (np.cumsum(whole) if place["delta"] else whole) * place["scale"]
