"""Example programs; README.md lists them."""
