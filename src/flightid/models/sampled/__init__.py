"""What sampled black boxes share: channels, recursions, roots in the z plane, coefficients."""
