"""A slow, simple renderer in float64 NumPy that checks the engine.

It shares neither code nor method with `jaxenstein.engine`, only the conventions: x grows along a
row of the map, and y down the rows. Tile (column, row) covers [column, column + 1) x
[row, row + 1). Heading 0 faces +x, and headings grow clockwise on the map. Everything outside the
map is solid.
"""
