"""Bambu Studio and OrcaSlicer."""

from decmcts.formats.slicers.dialect import Dialect
from decmcts.print.contours import Role

DIALECT = Dialect(
    signs={"BambuStudio": "BambuStudio", "OrcaSlicer": "OrcaSlicer"},
    roles={
        Role.EXTERNAL_PERIMETER: ("outer wall",),
        Role.PERIMETER: ("inner wall",),
        Role.OVERHANG_PERIMETER: ("overhang wall",),
        Role.INFILL: ("sparse infill",),
        Role.SOLID_INFILL: ("internal solid infill", "bottom surface"),
        Role.TOP_SOLID_INFILL: ("top surface",),
        Role.BRIDGE_INFILL: ("bridge", "internal bridge"),
        Role.GAP_FILL: ("gap infill",),
        Role.IRONING: ("ironing",),
        Role.SKIRT_BRIM: ("skirt", "brim"),
        Role.SUPPORT: ("support", "support transition"),
        Role.SUPPORT_INTERFACE: ("support interface",),
        Role.WIPE_TOWER: ("prime tower",),
        Role.CUSTOM: ("custom",),
    },
    layers=("CHANGE_LAYER$",),
    notes=("LAYER NUM/TOTAL_LAYER_COUNT:",),
    values={"LINE_WIDTH": "width", "LAYER_HEIGHT": "height", "Z_HEIGHT": "layer"},
    objects=("start printing object",),
    objects_end=("stop printing object",),
    numbered=("start printing object, unique", "stop printing object, unique"),
    changes=("WIPE_TOWER_START",),
    changes_end=("WIPE_TOWER_END",),
    time_words=("total ", "estimated ", "model ", "printing ", "first ", "layer "),
    layer_time=("slow_down_layer_time",),
    slows=("slow_down_for_layer_cooling",),
    max_feed=("machine_max_speed_",),
    radius=("extruder_clearance_radius", "extruder_clearance_max_radius"),
    rod=("extruder_clearance_height_to_rod", "extruder_clearance_height_to_lid"),
    bed=("printable_area",),
)
