"""MiniGrid's worlds in first person: things to carry, doors that close again, lava, wanderers.

`world` has the rules, `state` what they change, `view` how it looks; `sketch` lays a world out at
reset, `planner` solves them all; the other modules are families of worlds.
"""
