"""Whatever a reader raises becomes one line with the file's name, and bugs are told from damage."""

from __future__ import annotations

import json
import struct
import zipfile
import zlib

import pytest

from fabricusd.errors import REPORT, FabricError, described, one_line, reading, reads


def raised(error: BaseException) -> str:
    with pytest.raises(FabricError) as caught, reading("a.xyz", "a thing"):
        raise error
    assert caught.value.__cause__ is error
    assert str(caught.value) == one_line(str(caught.value))
    return str(caught.value)


DAMAGE = {
    "zlib": zlib.error("Error -3 while decompressing data"),
    "zip": zipfile.BadZipFile("File is not a zip file"),
    "struct": struct.error("unpack requires a buffer of 4 bytes"),
    "end": EOFError(),
    "json": json.JSONDecodeError("Expecting value", "x", 0),
    "unicode": UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"),
    "value": ValueError("two\nlines\x1b[31m"),
    "runtime": RuntimeError("a library's own"),
    "stop": StopIteration("of an iterator"),
}
BUGS = {
    "index": IndexError("list index out of range"),
    "key": KeyError("points"),
    "type": TypeError("'NoneType' object is not subscriptable"),
    "attribute": AttributeError("no attribute 'uv'"),
    "assertion": AssertionError(),
    "division": ZeroDivisionError("division by zero"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_told_with_file_kind_and_what_was_raised(name):
    error = DAMAGE[name]
    line = raised(error)
    name = f"{name}.error" if name in ("zlib", "struct") else type(error).__name__
    assert line.startswith(f"a.xyz cannot be read as a thing: {name}")
    assert REPORT not in line


@pytest.mark.parametrize("name", BUGS)
def test_what_only_a_bug_explains_asks_for_a_report(name):
    line = raised(BUGS[name])
    assert line.startswith(f"a.xyz cannot be read as a thing: {type(BUGS[name]).__name__}")
    assert line.endswith(REPORT)


def test_what_the_system_refuses_is_told_in_its_words():
    assert (
        raised(PermissionError(13, "Permission denied"))
        == "a.xyz cannot be read: Permission denied"
    )
    assert "there is not enough memory" in raised(MemoryError())
    assert "nested too deeply" in raised(RecursionError("maximum recursion depth exceeded"))


@pytest.mark.parametrize(
    "error", [FabricError("x", "is wrong"), UserWarning("w"), KeyboardInterrupt()]
)
def test_what_is_not_the_files_fault_goes_through(error):
    with pytest.raises(type(error)) as caught, reading("a.xyz", "a thing"):
        raise error
    assert caught.value is error


def test_a_reader_names_its_file_however_it_is_called(tmp_path):
    class Kept:
        @classmethod
        @reads("a thing")
        def load(cls, path, size=0):
            return [1, 2][size], path

    assert Kept.load("a.xyz") == (1, "a.xyz")
    for call in (lambda: Kept.load("a.xyz", 7), lambda: Kept.load(size=7, path="a.xyz")):
        with pytest.raises(FabricError, match=r"a\.xyz cannot be read as a thing: IndexError: "):
            call()
    with pytest.raises(FabricError, match="the input cannot be read as a thing: TypeError"):
        Kept.load()


def test_a_library_that_says_a_whole_page_is_cut():
    assert len(described(ValueError("x " * 5000))) <= 300
