"""The `.map` text format of Quake's level editors: entities, brushes and patches.

An entity is `{`, pairs of quoted strings, brushes, `}`. A brush is the space behind several
planes, each given by three points and a texture. A patch (`patchDef2`) is a curved or flat sheet
over a grid of control points. `//` starts a comment.
"""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import dataclass, field

from ...errors import MapError, MapWarning, quoted

Point = tuple[float, float, float]

LARGEST = 1_000_000.0
"""The largest accepted coordinate."""

_TOKEN = re.compile(r'//.*|"[^"]*"|[(){}]|[^\s(){}"]+|"')
_END = ""


@dataclass(frozen=True)
class Plane:
    """A plane of a brush: three points on it, and its texture."""

    points: tuple[Point, Point, Point]
    texture: str


@dataclass(frozen=True)
class Brush:
    """A solid: its planes, and the line where it starts."""

    planes: tuple[Plane, ...]
    line: int


@dataclass(frozen=True)
class Patch:
    """A sheet: its texture and control points, and the line where it starts."""

    texture: str
    points: tuple[Point, ...]
    line: int


@dataclass
class Entity:
    """An entity with properties; `classname` is its kind.

    Attributes:
        line: the line where it starts.
        properties: its pairs of strings.
        brushes: its solids.
        patches: its sheets.
    """

    line: int
    properties: dict[str, str] = field(default_factory=dict)
    brushes: list[Brush] = field(default_factory=list)
    patches: list[Patch] = field(default_factory=list)

    @property
    def classname(self) -> str:
        """The kind of entity; "" if the file does not say."""
        return self.properties.get("classname", "")


def read_entities(text: str, source: str = "") -> list[Entity]:
    """Read a `.map` file.

    Args:
        text: the content of the file.
        source: the name of the file, for errors.

    Raises:
        MapError: the file is invalid; the message names the line.

    Warns:
        MapWarning: an entity starts without its brace; the message names the line. The entity is
            read anyway, because two of DeepMind Lab's own mazes have this fault.
    """
    reader = _Reader(text, source)
    entities = []
    while reader.token != _END:
        entities.append(_entity(reader))
    return entities


class _Reader:
    """Reads the tokens of a text one by one; `token` is the next one."""

    def __init__(self, text: str, source: str) -> None:
        self.source = source
        lines = re.split(r"\r\n|\r|\n", text.removeprefix("\ufeff"))
        self._last = len(lines)
        self._tokens = (
            (match.group(), number)
            for number, line in enumerate(lines, start=1)
            for match in _TOKEN.finditer(line)
            if not match.group().startswith("//")
        )
        self.token, self.line = _END, 1
        self.take()

    def take(self) -> str:
        """Read the next token."""
        token = self.token
        self.token, self.line = next(self._tokens, (_END, self._last))
        return token

    def expect(self, wanted: str, where: str) -> None:
        """Read the token `wanted`."""
        if self.token != wanted:
            raise self.error(f"expected {quoted(wanted)} {where}, found {self.quoted_token()}")
        self.take()

    def quoted_token(self) -> str:
        """The next token, for messages."""
        short = self.token if len(self.token) <= 40 else f"{self.token[:40]}..."
        return repr(short) if self.token else "the end of the file"

    def number(self, where: str) -> float:
        """Read a finite number in the range of coordinates."""
        try:
            value = float(self.token)
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST:
            limit = f"from {-LARGEST:.0f} to {LARGEST:.0f}"
            raise self.error(f"expected a number {limit} {where}, found {self.quoted_token()}")
        self.take()
        return value

    def word(self, where: str) -> str:
        """Read an unquoted name."""
        if self.token in (_END, *"(){}") or self.token.startswith('"'):
            raise self.error(f"expected a name {where}, found {self.quoted_token()}")
        return self.take()

    def error(self, message: str) -> MapError:
        """An error at the next token."""
        return MapError(message, line=self.line, source=self.source)


def _entity(reader: _Reader) -> Entity:
    entity = Entity(reader.line)
    where = f"in the entity of line {entity.line}"
    if reader.token.startswith('"') and len(reader.token) > 1:
        problem = reader.error(f"an entity starts without '{{', with {reader.quoted_token()}")
        warnings.warn(str(problem), MapWarning, stacklevel=4)
    else:
        reader.expect("{", "at the start of an entity")
    while reader.token != "}":
        if reader.token == "{":
            _brush(reader, entity)
        else:
            key = _quoted(reader, f"{where} (a quoted key, '{{' or '}}')")
            entity.properties[key] = _quoted(reader, f"{where}, the value of {quoted(key)}")
    reader.take()
    return entity


def _quoted(reader: _Reader, where: str) -> str:
    token = reader.token
    if len(token) < 2 or token[0] != '"':
        raise reader.error(f"expected a quoted string {where}, found {reader.quoted_token()}")
    reader.take()
    return token[1:-1]


def _brush(reader: _Reader, entity: Entity) -> None:
    line = reader.line
    reader.take()
    if reader.token == "(":
        planes = []
        while reader.token == "(":
            planes.append(_plane(reader))
        entity.brushes.append(Brush(tuple(planes), line))
    else:
        if reader.token != "patchDef2":
            raise reader.error(
                f"expected a plane or patchDef2 in a brush, found {reader.quoted_token()}"
            )
        reader.take()
        entity.patches.append(_patch(reader, line))
    reader.expect("}", f"after the brush of line {line}")


def _plane(reader: _Reader) -> Plane:
    points = _point(reader), _point(reader), _point(reader)
    texture = reader.word("of a texture after the points of a plane")
    # Shift, rotation and scale of the texture, and flags; not all editors write all of them.
    while reader.token not in (_END, *"(){}"):
        reader.number(f"after the texture {texture}")
    return Plane(points, texture)


def _point(reader: _Reader) -> Point:
    reader.expect("(", "before a point")
    point = reader.number("in a point"), reader.number("in a point"), reader.number("in a point")
    reader.expect(")", "after a point")
    return point


def _patch(reader: _Reader, line: int) -> Patch:
    reader.expect("{", "after patchDef2")
    texture = reader.word("of a texture")
    reader.expect("(", "before the size of a patch")
    size = []
    while reader.token != ")":
        size.append(reader.number("in the size of a patch"))
    reader.take()
    reader.expect("(", "before the rows of a patch")
    points: list[Point] = []
    while reader.token == "(":
        reader.take()
        while reader.token == "(":
            points.append(_control_point(reader))
        reader.expect(")", "after a row of a patch")
    reader.expect(")", "after the rows of a patch")
    reader.expect("}", "after a patch")
    if len(size) < 2 or not points or size[0] * size[1] != len(points):
        shape = " by ".join(f"{length:g}" for length in size[:2])
        message = f"a patch of {shape or 'no'} control points has {len(points)} of them"
        raise MapError(message, line=line, source=reader.source)
    return Patch(texture, tuple(points), line)


def _control_point(reader: _Reader) -> Point:
    reader.take()
    where = "in a control point"
    x, y, z, *_ = (reader.number(where) for _ in range(5))
    reader.expect(")", "after a control point")
    return x, y, z
