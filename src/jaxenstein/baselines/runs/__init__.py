"""Run directories: experiments with their options, checkpoints, metrics and trained agents."""
