"""Communicates: messages, codec, protocol, transports, extruder processes, launcher."""

PART_OF = "decmcts"  # other distributions have packages of this name
