"""Writing a plan that passed the judge, each file whole or not at all."""
