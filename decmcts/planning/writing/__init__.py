"""What is written of a plan that passed the judge, each file whole or not at all."""
