"""Learning experiments: configurations, and the script that runs one with every algorithm."""
