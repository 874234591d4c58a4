"""The rules of each family of environments."""
