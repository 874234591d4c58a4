"""Measuring how many steps a second an environment makes, and what compiling it costs."""
