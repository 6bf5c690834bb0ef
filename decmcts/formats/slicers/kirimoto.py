"""Kiri:Moto."""

from decmcts.formats.slicers.dialect import Dialect

DIALECT = Dialect(
    signs={"Kiri:Moto": "Kiri:Moto"},
    layers=("-+ LAYER ",),
    time_words=("print ",),
)
