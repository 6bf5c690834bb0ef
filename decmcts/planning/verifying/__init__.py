"""Plans and finished files judged again."""
