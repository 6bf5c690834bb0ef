"""From a joint order to exact paths, times and waits."""
