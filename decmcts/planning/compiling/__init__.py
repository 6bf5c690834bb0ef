"""What is compiled on this machine, and compiling the rest beside a run."""
