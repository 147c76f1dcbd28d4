"""What all fits to records share: options, set-up, statistics."""
