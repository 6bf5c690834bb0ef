"""Planning from file to file: what a program calls, the command line among them.

`read`, `plan`, `launch`, `verify` and `bound` are one module each; `result` writes what
they found, `options` is what they are asked and `events` what they tell meanwhile. The rooms
below do the work: `problem` (a print, its machine, its own order judged), `one_head`,
`team`, `verifying`, `writing` and `compiling`. Nothing here prints or knows arguments of a
command line. `import decmcts` has the names of this room (docs/api.md).
"""
