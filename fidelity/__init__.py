"""Comparisons of the environments with the tasks they are ports of."""
