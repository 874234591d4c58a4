"""Play by hand: windows and terminals, keys, and the game between them."""
