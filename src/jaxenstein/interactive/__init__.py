"""Playing by a person: a window or a terminal, keys, and the game between them."""
