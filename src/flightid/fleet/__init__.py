"""Fleets: thousands of logs through one study, and one catalogue of what came of them."""
