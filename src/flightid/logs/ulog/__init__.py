"""ULog files of PX4."""
