; on each board, then again on each, before files are started
M42 P1 S0
set global.given = vector(65, 0)
