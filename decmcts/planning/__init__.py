"""Planning from file to file: the functions a program calls. The command line is one such program.

`plan`, `launch`, `verify` and `simulate` are one module each, `bare` has the solvers of bare
problems. `options` has their options, `events` the events they report while they work, and
`result` what `plan` and `launch` return and how it is written. The rooms below do the work.
Nothing here prints or knows arguments of a command line. `import decmcts` has the names of this
room (docs/api.md).
"""
