"""MiniWorld's environments, one metre per tile.

Rules and numbers are those of Farama-Foundation/Miniworld; docs/originals/miniworld.md and
miniworld-objects.md list the differences.
"""
