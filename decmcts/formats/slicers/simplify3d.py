"""Simplify3D."""

from decmcts.formats.slicers.dialect import Dialect
from decmcts.print.contours import Role

DIALECT = Dialect(
    signs={"Simplify3D(R)": "Simplify3D"},
    roles={
        Role.EXTERNAL_PERIMETER: ("outer perimeter",),
        Role.PERIMETER: ("inner perimeter",),
        Role.INFILL: ("infill",),
        Role.SOLID_INFILL: ("solid layer",),
        Role.BRIDGE_INFILL: ("bridge",),
        Role.GAP_FILL: ("gap fill", "single extrusion"),
        Role.SKIRT_BRIM: ("skirt", "raft"),
        Role.SUPPORT: ("support", "dense support"),
        Role.WIPE_TOWER: ("prime pillar",),
    },
    layers=(r"LAYER\s*+(?::\s*+)?-?\d++\s*+(,|$)",),
    time_words=("build ",),
    layer_time=("minSpeedLayerTime",),
    slows=("adjustSpeedForCooling",),
)
