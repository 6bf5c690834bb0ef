"""What no joint plan can beat."""
