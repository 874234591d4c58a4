"""The subjects of the benchmarks; `python -m benchmarks.subjects NAME` runs one in a process."""
