"""Importers that convert maps of other projects to tile maps."""
