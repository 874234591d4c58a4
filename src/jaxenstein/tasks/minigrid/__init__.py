"""MiniGrid's worlds in first person: things to carry, doors that close again, lava, wanderers.

`world` has the rules, `sketch` lays a world out at reset, `rooms` does so with a grid of rooms,
`player` solves them all; the other modules are families of worlds, and `table` lists their sizes.
"""
