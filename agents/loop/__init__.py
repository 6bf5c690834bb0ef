"""The loop of one agent, with planner, protocol and network as arguments."""
