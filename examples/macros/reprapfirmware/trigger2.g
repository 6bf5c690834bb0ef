; the second head has given a signal
set global.given[2] = global.given[2] + 1
