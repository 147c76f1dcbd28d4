"""Transfer-function models (native: `transfer.rs`)."""
