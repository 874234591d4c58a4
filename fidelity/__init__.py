"""Comparisons of environments with their originals."""
