"""Measurements of the project and of others beside it. Not part of the installed package."""
