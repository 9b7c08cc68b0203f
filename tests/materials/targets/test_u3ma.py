"""Archives of U3M materials: the format's subset of ZIP."""

from __future__ import annotations

import struct
import zipfile

import pytest

from fabricusd.errors import FabricError
from fabricusd.materials.targets.u3ma import write_u3ma


@pytest.fixture
def archive(tmp_path):
    (tmp_path / "linen_u3m").mkdir()
    files = [tmp_path / "linen.u3m", tmp_path / "linen_u3m" / "alpha.png"]
    files[0].write_text('{"schema": "1.1"}' * 40)
    files[1].write_bytes(bytes(range(256)))
    return write_u3ma(tmp_path / "linen.u3ma", files), files


def test_it_holds_the_files_by_their_relative_paths(archive):
    path, files = archive
    with zipfile.ZipFile(path) as read:
        assert read.testzip() is None
        assert read.namelist() == ["linen.u3m", "linen_u3m/alpha.png"]
        assert [read.read(name) for name in read.namelist()] == [f.read_bytes() for f in files]


def test_its_headers_are_those_that_the_format_allows(archive):
    data = archive[0].read_bytes()
    signature, *zeros, first, count, size, place, comment = struct.unpack("<4s4H2IH", data[-22:])
    assert signature == b"PK\5\6"
    assert (zeros, first, count, comment) == ([0, 0], 2, 2, 0)
    assert place + size == len(data) - 22
    begin = 0
    for _ in range(count):
        central = struct.unpack_from("<4s6H3I5H2I", data, place)
        (mark, made_by, needed, flags, method, *_, name, extra, note, disk, inner, outer, local) = (
            central
        )
        assert (mark, made_by, needed, flags) == (b"PK\1\2", 0x3F, 0x14, 1 << 11)
        assert method in (0, 8)
        assert (extra, note, disk, inner, outer) == (0, 0, 0, 0, 0)
        # Entries follow one another from the first byte on.
        assert local == begin
        header = struct.unpack_from("<4s5H3I2H", data, local)
        assert header[0] == b"PK\3\4"
        assert header[1:9] == central[2:10]
        assert header[9:] == (name, 0)
        begin += 30 + name + central[8]
        place += 46 + name
    assert begin == place - size


def test_another_suffix_is_refused(tmp_path):
    with pytest.raises(FabricError, match=r"\.u3ma"):
        write_u3ma(tmp_path / "linen.zip", [])
    assert not list(tmp_path.iterdir())
