"""Maps on the host: text to `TileMap`, in numpy alone. Nothing here imports JAX."""

from .ascii import layout_names, load_layout, parse_ascii
from .symbols import legend
from .tilemap import MAX_SIZE, Door, Item, Key, TileMap

__all__ = [
    "MAX_SIZE",
    "Door",
    "Item",
    "Key",
    "TileMap",
    "layout_names",
    "legend",
    "load_layout",
    "parse_ascii",
]
