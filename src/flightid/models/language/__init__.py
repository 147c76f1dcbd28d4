"""The model language: formulas, units, blocks, tables and what reads them."""
