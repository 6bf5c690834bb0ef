"""What must come before what, and how long after."""
