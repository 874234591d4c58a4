"""What is measured: each subject in a process of its own, `python -m benchmarks.subjects NAME`."""
