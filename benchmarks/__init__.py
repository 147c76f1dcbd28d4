"""Speed against peers: same data, same run, ratios printed. Run with `make bench`."""
