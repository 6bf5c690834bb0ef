"""Communicates: messages, codec, protocol, transports, extruder processes, launcher."""
