"""How long a launcher waits for what. All in seconds.

The longest that agents can take, from when all are ready, is the time for planning and
`AGREE_LIMIT_S`, or `HUNG_S` where all are stopped; `AFTER_FENCE_S` more where a head is given
up at the end of that. Only rounds of more than `AGREE_LIMIT_S / AGREE_ROUNDS` make it longer.
"""

GRACE_S = 2.0
"""Who was heard since so long ago speaks: four pulses, and twice the lease of links."""

HUNG_S = 8.0
"""Who is not heard for so long is stopped, and counts as dead: longer than any pause that
people make by accident, and short beside a print."""

START_LIMIT_S = 180.0
"""To load the problem and compile; a head that takes longer is fenced."""

UNHEARD_S = 12.0
"""Until the first sign of life of a process, and a second more for each head. Once another
agent is ready, `HUNG_S` and half a second for each head: all begin at the same time."""

AGREE_LIMIT_S = 10.0
"""From the first agent that ends planning to the release, and `AGREE_HEAD_S` for each head
above two. Where rounds are long, so many of them: an agent is told of the others' end only
after its round, and then resolves their plans."""

AGREE_HEAD_S = 2.0

AGREE_ROUNDS = 8.0

RETURN_S = 15.0
"""The others wait so long, from the end of planning, for an agent that was started again: it
loads for seconds, and with its head a print may take half the time."""

LATE_LIMIT_S = 120.0
"""From the end of the time for planning until some agent says that it ended: a last resort,
for rounds that take very long."""

FOLLOW_LIMIT_S = 5.0
"""From the first release to the last: by then every live head has agreed, so one
that says nothing any more is dead or stopped."""

AFTER_FENCE_S = 3.0
"""What is left to agree on after a head was given up, at least."""

MEET_S = 3.0
"""Agents that speak but miss each other for so long meet elsewhere, at most `MOST_MOVES` times."""

MEET_HEAD_S = 1.0
"""So much longer for each head above two: many need longer to find each other, and on a
host with few processors they lose each other for a moment now and then."""

MOST_MOVES = 2
