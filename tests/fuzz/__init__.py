"""Damaged files at every Python reader: results or typed errors, in bounded time and memory."""
