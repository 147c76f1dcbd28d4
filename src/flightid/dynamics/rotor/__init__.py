"""What identified numbers say of a rotor."""
