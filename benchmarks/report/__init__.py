"""The pages of figures, written from results alone: `python -m benchmarks.report DIR`."""
