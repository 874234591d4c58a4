"""A slow, plain renderer in float64 numpy, written apart from the engine to check it.

It shares neither code nor method with `jaxenstein.engine`; both follow the conventions of the
design alone: x grows along a row of the map, y down the rows; tile (column, row) covers
[column, column + 1) x [row, row + 1); heading 0 looks along +x and grows clockwise on the map;
everything outside the map is solid.
"""
