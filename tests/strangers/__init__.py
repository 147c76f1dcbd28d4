"""Flights of simulators that are not flightid's own, and what its intervals hold on them."""
