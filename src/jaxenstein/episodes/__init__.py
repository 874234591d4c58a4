"""Single episodes on the host: playing them step by step, recording them, replaying them."""
