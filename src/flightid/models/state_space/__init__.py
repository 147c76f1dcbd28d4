"""State-space models: equations with units (native: `model_tape.rs`)."""
