"""How agents come to one plan, as a state machine: no socket, thread or clock."""
