"""Training: the speed of the baselines."""
