"""Measure how many steps per second an environment takes, and how long it compiles."""
