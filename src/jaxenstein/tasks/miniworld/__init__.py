"""MiniWorld's environments, a metre to a tile.

Rules and numbers are those of Farama-Foundation/Miniworld; docs/originals/miniworld.md and
miniworld-objects.md say where the ports differ.
"""
