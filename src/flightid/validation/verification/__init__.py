"""How models predict records they have not seen."""
