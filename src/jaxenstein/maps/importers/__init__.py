"""Maps of other projects, read and converted to tile maps."""
