"""Exploration bonuses."""
