"""Maps on the host: text to `TileMap`, with numpy."""

from .ascii import layout_names, load_layout, parse_ascii
from .own_things import register_thing
from .symbols import label_name, legend
from .tilemap import MAX_SIZE, Door, Item, Key, TileMap

__all__ = [
    "MAX_SIZE",
    "Door",
    "Item",
    "Key",
    "TileMap",
    "label_name",
    "layout_names",
    "legend",
    "load_layout",
    "parse_ascii",
    "register_thing",
]
