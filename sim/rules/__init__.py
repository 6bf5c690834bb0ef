"""What must come before what, and the least time between them."""
