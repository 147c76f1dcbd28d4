"""What a fleet's estimates say together: the type, its odd vehicles, and what changed when."""
