"""DataFlash logs of ArduPilot."""
