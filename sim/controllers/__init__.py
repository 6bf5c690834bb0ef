"""A print carried out: what controllers make of their files, in time.

`program` is what one controller is given, `from_plan` and `from_files` make it, `motion` says how
fast it moves, `timing` what goes wrong with its time, `carry_out` who waits for whom, `nearness`
how near heads come, `print_contacts` where they touch the print, and `simulate` puts it together.
Neither the planner's time model nor the judge's is used.
"""
