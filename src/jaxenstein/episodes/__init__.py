"""Single episodes on the host: play them step by step, record them, replay them."""
