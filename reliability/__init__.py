"""Checks beyond the tests: fuzzing, endurance, lanes, and golden episodes."""
