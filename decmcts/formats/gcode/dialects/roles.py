"""The words slicers use for what a bead is for, mapped to `Role`."""

from __future__ import annotations

import re

from decmcts.formats.slicers import slic3r
from decmcts.formats.slicers.known import DIALECTS
from decmcts.print.contours import Role

BY_NAME = {
    name: role for known in DIALECTS for role, names in known.roles.items() for name in names
}
CANONICAL = {role: names[0].capitalize() for role, names in slic3r.DIALECT.roles.items()}
CANONICAL[Role.SKIRT_BRIM] = "Skirt/Brim"
_TYPED = re.compile(r"(?:TYPE|FEATURE)\s*:\s*(.*)$", re.I)
_KISS = re.compile(r"'([^']+ Path)'", re.I)


def _name(body: str) -> str:
    if match := _TYPED.match(body):
        return match.group(1).strip().lower()
    if match := _KISS.match(body):
        return match.group(1).lower()
    return body.strip().lower().removeprefix("feature ")


def is_role_comment(body: str) -> bool:
    """Tell whether a comment (without its marks) names what the next beads are for."""
    if _TYPED.match(body):
        return True
    return _name(body) in BY_NAME and (":" not in body)


def role_of(text: str) -> Role:
    """Return the role a comment names; UNKNOWN for words that are not known."""
    return BY_NAME.get(_name(text.lstrip("; (").rstrip(") ")), Role.UNKNOWN)


def trailing_role(comment: str) -> Role:
    """Return the role a comment behind a move names (Slic3r's ``--gcode-comments``)."""
    return BY_NAME.get(comment.lstrip("; ").strip().lower(), Role.UNKNOWN)
