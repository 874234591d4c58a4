"""WAD directories and UDMF text, built by hand."""

from __future__ import annotations

import struct

import pytest

from fidelity.wad import find_lump, parse_udmf, read_lump
from jaxenstein.errors import MapError


def wad(lumps: dict[str, bytes], kind: bytes = b"PWAD") -> bytes:
    """A WAD file: header, lumps, directory."""
    body, entries = b"", b""
    for name, data in lumps.items():
        entries += struct.pack("<II8s", 12 + len(body), len(data), name.encode())
        body += data
    return struct.pack("<4sII", kind, len(lumps), 12 + len(body)) + body + entries


def test_a_lump_is_found_by_name() -> None:
    data = wad({"MAP01": b"", "TEXTMAP": b"vertex {}", "ENDMAP": b""})
    assert find_lump(data, "TEXTMAP") == b"vertex {}"
    assert find_lump(data, "MAP01") == b""


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a WAD file"),
        (b"PK\3\4 and more bytes", "not a WAD file"),
        (wad({"TEXTMAP": b"x"})[:-1], "cut short: its directory of 1 entries at byte 13"),
        (wad({"MAP01": b"", "THINGS": b""}), "no lump TEXTMAP, only MAP01, THINGS"),
        (wad({}), "no lump TEXTMAP, only none"),
        (
            struct.pack("<4sII", b"IWAD", 1, 12) + struct.pack("<II8s", 20, 9, b"TEXTMAP"),
            "lump TEXTMAP ends at byte 29 of 28",
        ),
    ],
)
def test_a_damaged_file_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(MapError, match=message):
        find_lump(data, "TEXTMAP", "some.wad")


def test_a_missing_file_is_named(tmp_path) -> None:
    with pytest.raises(MapError, match=r"none\.wad: cannot be read"):
        read_lump(tmp_path / "none.wad", "TEXTMAP")


def test_blocks_are_numbered_by_kind_and_typed() -> None:
    text = """
    namespace = "zdoom"; // a global field
    Vertex { X = -1.5; y = 2e1; }   /* a comment
    of two lines */
    thing { type = 0x2A; Comment = "a \\"quoted\\" {brace}"; single = TRUE; coop = false; }
    vertex // 1
    { x = +3; y = .5; }
    """
    blocks = parse_udmf(text)
    assert list(blocks) == ["vertex", "thing"]
    first, second = blocks["vertex"]
    assert first.fields == {"x": -1.5, "y": 20.0}
    assert (second.number, second.line, second.fields) == (1, 6, {"x": 3.0, "y": 0.5})
    thing = blocks["thing"][0]
    assert thing.fields["comment"] == 'a "quoted" {brace}'
    assert thing.number_of("type") == 42
    assert thing.flag("single")
    assert not thing.flag("coop")
    assert not thing.flag("dm")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("vertex { x = 1;\n y = ; }", "line 2: expected a number, a string, true or false"),
        ("vertex { x = 1;", "expected the name of a field or '}', found the end of the text"),
        ("vertex { x = 1 }", "line 1: expected ';', found '}'"),
        ("vertex\n[ ]", r"line 2: unexpected '\['"),
        ("{ x = 1; }", "expected the name of a block"),
        ('thing { s = "open; }', "unexpected '\"'"),
    ],
)
def test_a_wrong_text_is_refused_with_its_line(text: str, message: str) -> None:
    with pytest.raises(MapError, match=message):
        parse_udmf(text)


def test_fields_of_the_wrong_kind_name_their_block() -> None:
    block = parse_udmf("linedef {}\nlinedef { v1 = 2.5; v2 = 7; id = true; }")["linedef"][1]
    with pytest.raises(MapError, match=r"line 2: linedef 1: 'v1' is 2\.5, not one of 0 to 8"):
        block.index_of("v1", 9)
    with pytest.raises(MapError, match="'v2' is 7, not one of 0 to 6"):
        block.index_of("v2", 7)
    with pytest.raises(MapError, match="'sidefront' must be a number but is missing"):
        block.number_of("sidefront")
    with pytest.raises(MapError, match="'id' must be a number but is True"):
        block.number_of("id")
    with pytest.raises(MapError, match=r"'v1' must be a string but is 2\.5"):
        block.text_of("v1", "-")
