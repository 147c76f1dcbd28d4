"""Engines: many logs at once, each in a process that may hang, die or eat memory by itself."""
