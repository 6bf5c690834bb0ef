"""What no order can beat, and best orders where there are few."""
