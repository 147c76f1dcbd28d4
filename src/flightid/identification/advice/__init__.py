"""What records can support before a structure is chosen."""
