"""Run directories: what is trained, its options, checkpoints, metrics, and what they gave."""
