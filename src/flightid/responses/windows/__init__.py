"""Windows: how a record is cut, tapered and transformed."""
