"""Control: loops around identified models, their margins, and gains with margins over doubt."""
