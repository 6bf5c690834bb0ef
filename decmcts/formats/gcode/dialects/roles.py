"""The words slicers use for what a bead is for, mapped to `Role`."""

from __future__ import annotations

import re

from decmcts.print.contours import Role

_NAMES = {
    Role.EXTERNAL_PERIMETER: (
        "external perimeter", "outer wall", "wall-outer", "outer perimeter", "perimeter path",
        "external-perimeter", "outer shell",
    ),
    Role.PERIMETER: (
        "perimeter", "internal perimeter", "inner wall", "wall-inner", "inner perimeter",
        "loop path", "inner shell", "shells",
    ),
    Role.OVERHANG_PERIMETER: ("overhang perimeter", "overhang wall"),
    Role.INFILL: (
        "internal infill", "sparse infill", "fill", "infill", "sparse infill path",
        "stacked sparse infill path", "internal-infill",
    ),
    Role.SOLID_INFILL: (
        "solid infill", "internal solid infill", "bottom surface", "solid layer", "solid-fill",
        "solid path", "solid fill", "crown path", "skin",
    ),
    Role.TOP_SOLID_INFILL: ("top solid infill", "top surface", "top-fill"),
    Role.BRIDGE_INFILL: (
        "bridge infill", "bridge", "internal bridge", "internal bridge infill", "bridge path",
    ),
    Role.GAP_FILL: ("gap fill", "gap infill", "thin wall", "single extrusion", "gap-fill"),
    Role.IRONING: ("ironing",),
    Role.SKIRT_BRIM: ("skirt/brim", "skirt", "brim", "skirt path", "brim path", "raft"),
    Role.SUPPORT: (
        "support material", "support", "support path", "dense support", "support transition",
        "support-material",
    ),
    Role.SUPPORT_INTERFACE: (
        "support material interface", "support interface", "support-interface",
        "support interface path",
    ),
    Role.WIPE_TOWER: ("wipe tower", "prime tower", "prime-tower", "prime pillar"),
    Role.CUSTOM: ("custom",),
}  # fmt: skip
BY_NAME = {name: role for role, names in _NAMES.items() for name in names}
CANONICAL = {role: names[0].capitalize() for role, names in _NAMES.items()}
CANONICAL[Role.SKIRT_BRIM] = "Skirt/Brim"
CANONICAL[Role.INFILL] = "Internal infill"
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
