"""Scripts to run and read; the prints are in `decmcts/samples`."""
