"""Joint plans as plan.json, and back."""
