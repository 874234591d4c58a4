"""MiniGrid's worlds in first person: things to carry, doors, lava, moving obstacles.

`world` has the rules, `state` the state that they change, `view` the rendering. `sketch` lays out a
world at reset, `planner` solves all of them. The other modules are families of worlds.
"""
