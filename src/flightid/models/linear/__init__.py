"""Linear systems: matrices with delays, sampling, realisation, interchange with other tools."""
