"""Slic3r, PrusaSlicer and SuperSlicer."""

from decmcts.formats.slicers.dialect import Dialect
from decmcts.print.contours import Role

DIALECT = Dialect(
    signs={
        "PrusaSlicer": "PrusaSlicer", "SuperSlicer": "SuperSlicer", "Slic3r": "Slic3r",
        "Slic3r Prusa Edition": "Slic3r Prusa Edition",
    },
    roles={
        Role.EXTERNAL_PERIMETER: ("external perimeter",),
        Role.PERIMETER: ("perimeter", "internal perimeter"),
        Role.OVERHANG_PERIMETER: ("overhang perimeter",),
        Role.INFILL: ("internal infill", "infill"),
        Role.SOLID_INFILL: ("solid infill", "internal solid infill"),
        Role.TOP_SOLID_INFILL: ("top solid infill",),
        Role.BRIDGE_INFILL: ("bridge infill", "internal bridge infill"),
        Role.GAP_FILL: ("gap fill", "thin wall"),
        Role.IRONING: ("ironing",),
        Role.SKIRT_BRIM: ("skirt/brim", "skirt", "brim"),
        Role.SUPPORT: ("support material",),
        Role.SUPPORT_INTERFACE: ("support material interface",),
        Role.WIPE_TOWER: ("wipe tower",),
        Role.CUSTOM: ("custom",),
    },
    layers=("LAYER_CHANGE$",),
    notes=("(BEFORE|AFTER)_LAYER_CHANGE$", r"-?(\d++(?:\.\d*+)?|\.\d++)$"),
    values={"WIDTH": "width", "HEIGHT": "height", "Z": "layer"},
    objects=("printing object",),
    objects_end=("stop printing object",),
    changes=("CP TOOLCHANGE START",),
    changes_end=("CP TOOLCHANGE END",),
    time_words=("estimated ", "printing ", "first ", "layer "),
    layer_time=("slowdown_below_layer_time",),
    slows=("cooling",),
    bare_inside=("only_retract_when_crossing_perimeters",),
    max_feed=("machine_max_feedrate_",),
    radius=("extruder_clearance_radius",),
    rod=("extruder_clearance_height",),
    bed=("bed_shape",),
    printers={
        "COREONEL": "coreonel", "COREONE": "coreone", "MK4S": "mk4s", "MK4": "mk4",
        r"MK3S?(MMU\w*)?$": "mk3s", "MINI": "mini", "XL": "xl", "HT90": "ht90",
    },
)  # fmt: skip
