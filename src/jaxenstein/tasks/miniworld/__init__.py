"""MiniWorld's environments, a metre to a tile.

Rules and numbers are those of Farama-Foundation/Miniworld; docs/fidelity.md says where the ports
differ.
"""
