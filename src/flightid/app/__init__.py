"""The local page: a server on the loopback, whose every click is a key of a study file."""
