"""Doom's map files: the directory of a WAD file, and the text of a UDMF map.

A WAD file is a header (kind, number of entries, offset of the directory), the lumps, and a
directory of 16 bytes an entry (offset, size, name). A map in the Universal Doom Map Format keeps
its geometry in the lump `TEXTMAP`: blocks `name { key = value; ... }` of things, vertices,
linedefs, sidedefs and sectors, each kind numbered from 0 in the order of the text.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from pathlib import Path

from jaxenstein.errors import MapError

Value = bool | float | str
_HEADER = struct.Struct("<4sII")
_ENTRY = struct.Struct("<II8s")
_TOKEN = re.compile(
    r"""(?P<space>\s+|//[^\n]*|/\*.*?\*/)
    |(?P<string>"(?:[^"\\]|\\.)*")
    |(?P<word>[A-Za-z_]\w*)
    |(?P<number>[+-]?(?:0[xX][0-9A-Fa-f]+|\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+))
    |(?P<mark>[{}=;])""",
    re.VERBOSE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """One block of a UDMF text: the line it begins in, from 1, and its fields."""

    kind: str
    number: int
    line: int
    fields: dict[str, Value] = field(default_factory=dict)

    def number_of(self, key: str, default: float | None = None) -> float:
        """A field that must be a number; `default` where it is missing, else a `MapError`."""
        value = self.fields.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            stands = "is missing" if value is None else f"is {value!r}"
            raise MapError(f"{self}: '{key}' must be a number but {stands}", line=self.line)
        return float(value)

    def index_of(self, key: str, count: int) -> int:
        """A field that must be a whole number from 0 to `count - 1`, else a `MapError`."""
        value = self.number_of(key)
        if value != int(value) or not 0 <= value < count:
            raise MapError(
                f"{self}: '{key}' is {value:g}, not one of 0 to {count - 1}", line=self.line
            )
        return int(value)

    def text_of(self, key: str, default: str) -> str:
        """A field that must be a string; `default` where it is missing."""
        value = self.fields.get(key, default)
        if not isinstance(value, str):
            raise MapError(f"{self}: '{key}' must be a string but is {value!r}", line=self.line)
        return value

    def flag(self, key: str) -> bool:
        """Whether a field is there and true."""
        return self.fields.get(key, False) is True

    def __str__(self) -> str:
        """Kind and number, as the format counts them."""
        return f"{self.kind} {self.number}"


def read_lump(path: str | Path, name: str) -> bytes:
    """The first lump of a WAD file with a name.

    Args:
        path: the file.
        name: the lump, such as `"TEXTMAP"`.

    Raises:
        MapError: if the file cannot be read, is no WAD file, is cut short or lacks the lump.
    """
    source = Path(path).name
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise MapError(f"cannot be read: {error.strerror or error}", source=source) from error
    return find_lump(data, name, source)


def find_lump(data: bytes, name: str, source: str = "") -> bytes:
    """As `read_lump`, of the bytes of a file; `source` is what messages call it."""
    if len(data) < _HEADER.size or data[:4] not in (b"IWAD", b"PWAD"):
        raise MapError("not a WAD file: it does not begin with IWAD or PWAD", source=source)
    _, count, directory = _HEADER.unpack_from(data)
    if directory + count * _ENTRY.size > len(data):
        raise MapError(
            f"cut short: its directory of {count} entries at byte {directory} does not fit into "
            f"{len(data)} bytes",
            source=source,
        )
    found = []
    for i in range(count):
        offset, size, raw = _ENTRY.unpack_from(data, directory + i * _ENTRY.size)
        found.append(raw.split(b"\0")[0].decode("ascii", "replace"))
        if found[-1] == name:
            if offset + size > len(data):
                raise MapError(
                    f"cut short: lump {name} ends at byte {offset + size} of {len(data)}",
                    source=source,
                )
            return data[offset : offset + size]
    raise MapError(f"has no lump {name}, only {', '.join(found) or 'none'}", source=source)


def parse_udmf(text: str, source: str = "TEXTMAP") -> dict[str, list[Block]]:
    """The blocks of a UDMF text by kind, kinds and keys in lower case; global fields are skipped.

    Raises:
        MapError: where the text does not follow the format, with the line.
    """
    tokens = _Tokens(text, source)
    blocks: dict[str, list[Block]] = {}
    while tokens.kind:
        kind, line = tokens.take("word", "the name of a block").lower(), tokens.last_line
        if tokens.text == "=":
            _value(tokens)
            continue
        tokens.expect("{")
        same = blocks.setdefault(kind, [])
        block = Block(kind, len(same), line)
        while tokens.text != "}":
            key = tokens.take("word", "the name of a field or '}'").lower()
            block.fields[key] = _value(tokens)
        tokens.expect("}")
        same.append(block)
    return blocks


def _value(tokens: _Tokens) -> Value:
    """Take `= value ;`."""
    tokens.expect("=")
    kind, text = tokens.kind, tokens.text
    value: Value
    if kind == "number":
        value = float(int(text, 16)) if text.lower().lstrip("+-").startswith("0x") else float(text)
    elif kind == "string":
        value = re.sub(r"\\(.)", r"\1", text[1:-1])
    elif text.lower() in ("true", "false"):
        value = text.lower() == "true"
    else:
        raise tokens.error("a number, a string, true or false")
    tokens.advance()
    tokens.expect(";")
    return value


class _Tokens:
    """The tokens of a text, one at a time; `kind` is empty after the last."""

    def __init__(self, text: str, source: str) -> None:
        self.source = source
        self._text = text
        self._at = 0
        self._line = 1
        self.kind = self.text = ""
        self.line = self.last_line = 1
        self.advance()

    def advance(self) -> None:
        """Go to the next token."""
        self.last_line = self.line
        while self._at < len(self._text):
            match = _TOKEN.match(self._text, self._at)
            if match is None:
                shown = self._text[self._at]
                raise MapError(f"unexpected {shown!r}", line=self._line, source=self.source)
            self.kind, self.text, self.line = str(match.lastgroup), match.group(), self._line
            self._at = match.end()
            self._line += self.text.count("\n")
            if self.kind != "space":
                return
        self.kind, self.text, self.line = "", "", self._line

    def take(self, kind: str, wanted: str) -> str:
        """The token here, which must be of a kind; go on to the next."""
        if self.kind != kind:
            raise self.error(wanted)
        text = self.text
        self.advance()
        return text

    def expect(self, mark: str) -> None:
        """Go past a mark that must be here."""
        if self.text != mark:
            raise self.error(repr(mark))
        self.advance()

    def error(self, wanted: str) -> MapError:
        """The error that something else should stand here."""
        found = repr(self.text) if self.kind else "the end of the text"
        return MapError(f"expected {wanted}, found {found}", line=self.line, source=self.source)
