; Signals between heads for RepRapFirmware 3.5 and later: one board a head, an output of each wired
; to an input of every other. Call it in config.g: M98 P"sync.g". Lines of the files: words.toml.
M950 P1 C"io2.out"              ; this board's output
M42 P1 S0
M950 J2 C"^io1.in"              ; input for the head whose file is the second
if !exists(global.given)
  global given = vector(65, 0)  ; signals given, by the place of the head's file
M581 P2 T2 S1 R0                ; the output goes up: trigger2.g
M581 P2 T3 S0 R0                ; and down: trigger3.g
