"""Filter error: a steady Kalman filter with estimated process noise."""
