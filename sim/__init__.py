"""The judge, and the reports, pictures and experiments beside it."""

PART_OF = "decmcts"  # other distributions have packages of this name
