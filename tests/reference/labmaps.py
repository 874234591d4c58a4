"""Write `.map` files of mazes as in DeepMind Lab, from text pictures of (2 * rows + 1) lines."""

from __future__ import annotations

CLASSES = {
    "S": ("info_player_start",),
    "a": ("apple_reward",),
    "@": ("info_player_start", "apple_reward"),
    "G": ("goal",),
}
COLOURS = {"#": "plain", "3": "green", "1": "red", "4": "yellow", "2": "blue"}
# Sides of a cell as (dx, dy) in the picture, whose lines run from north to south.
SIDES = {"west": (-1, 0), "east": (1, 0), "north": (0, -1), "south": (0, 1)}

CellSide = tuple[int, int, str]


def plane(axis: int, value: float, texture: str) -> str:
    """A plane perpendicular to an axis, as three points."""
    points = []
    for other in ((0, 0), (32, 0), (0, 32)):
        point = list(other)
        point.insert(axis, value)  # type: ignore[arg-type]
        points.append("( {} {} {} )".format(*point))
    return f"    {' '.join(points)} {texture} 0 0 0 0.5 0.5 0 0 0\n"


def brush(low: tuple[float, ...], high: tuple[float, ...], texture: str) -> str:
    """A box."""
    planes = [plane(axis, end[axis], texture) for axis in range(3) for end in (low, high)]
    return "  {\n" + "".join(planes) + "  }\n"


def floor(column: int, row: int) -> str:
    """The floor of a cell, row counted from the south."""
    x, y = 100 * column, 100 * row
    return brush((x, y, 0), (x + 100, y + 100, 1), "map/lab_games/style_floor_blue")


def panel(side: CellSide, colour: str) -> str:
    """A wall panel just inside a cell."""
    low, high = _box(side, 1)
    return brush(low, high, f"map/lab_games/style_wall_{colour}")


def decal(side: CellSide, picture: str) -> str:
    """A picture in front of a panel."""
    low, high = _box(side, 2)
    inner = {"west": (high[0], None), "east": (low[0], None)}
    inner |= {"south": (None, high[1]), "north": (None, low[1])}
    x, y = inner[side[2]]
    xs = [x] * 3 if x is not None else [low[0] + part for part in (20, 50, 80)]
    ys = [y] * 3 if y is not None else [low[1] + part for part in (20, 50, 80)]
    rows = [
        " ".join(f"( {x} {y} {z} 0 {z / 100} )" for z in (20, 50, 80))
        for x, y in zip(xs, ys, strict=True)
    ]
    points = "".join(f"        ( {row} )\n" for row in rows)
    body = f"      decal/{picture}\n      ( 3 3 0 0 0 )\n      (\n{points}      )\n"
    return f"  {{\n    patchDef2\n    {{\n{body}    }}\n  }}\n"


def entity(classname: str, *properties: tuple[str, str], inside: str = "") -> str:
    """An entity with its properties and brushes."""
    lines = [("classname", classname), *properties]
    return "{\n" + "".join(f'  "{key}" "{value}"\n' for key, value in lines) + inside + "}\n"


def thing(classname: str, column: int, row: int) -> str:
    """An entity in the middle of a cell."""
    return entity(classname, ("origin", f"{100 * column + 50} {100 * row + 50} 30"))


def write_map(
    picture: str,
    colours: dict[CellSide, str] | None = None,
    decals: dict[CellSide, str] | None = None,
) -> str:
    """The `.map` file of a maze.

    Args:
        picture: one character per tile. Between cells, all but '.' are walls, with colours from
            `COLOURS`. A cell is '.', a key of `CLASSES`, or '#' if it has no floor.
        colours: other colours of single panels, by (column, row from the south, side).
        decals: pictures on panels.
    """
    lines = picture.split()
    rows = len(lines) // 2
    brushes = entities = ""
    for line in range(1, len(lines), 2):
        for place in range(1, len(lines[line]), 2):
            column, row, mark = place // 2, rows - 1 - line // 2, lines[line][place]
            if mark == "#":
                continue
            brushes += floor(column, row)
            ceiling = (100 * column, 100 * row, 99), (100 * column + 100, 100 * row + 100, 100)
            brushes += brush(*ceiling, "map/lab_games/fake_sky")
            for side, (dx, dy) in SIDES.items():
                wall = lines[line + dy][place + dx]
                if wall != ".":
                    where = column, row, side
                    brushes += panel(where, (colours or {}).get(where, COLOURS[wall]))
            entities += "".join(thing(name, column, row) for name in CLASSES.get(mark, ()))
    brushes += "".join(decal(side, name) for side, name in (decals or {}).items())
    light = entity("light", ("origin", "0 0 70"), ("light", "55"))
    return entity("worldspawn", ("light", "100"), inside=brushes) + "\n" + entities + light


def _box(side: CellSide, thick: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The low and the high corner of a box at a side of a cell."""
    column, row, name = side
    low, high = [100.0 * column, 100.0 * row, 0.0], [100.0 * column + 100, 100.0 * row + 100, 100.0]
    axis = 0 if name in ("west", "east") else 1
    if name in ("west", "south"):
        high[axis] = low[axis] + thick
    else:
        low[axis] = high[axis] - thick
    return tuple(low), tuple(high)
