"""Pack a U3M material and its images as one archive, `.u3ma`.

The format is a subset of ZIP: deflated or stored files with UTF-8 names, and neither attributes,
extra fields, comments nor data descriptors. Times are in UTC. `zipfile` writes all of that but the
two flags that are set afterwards: bit 11 for every name, and no file attributes.
"""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from fabricusd.errors import FabricError
from fabricusd.files import whole_file

UTF8 = 1 << 11
"""The flag of names in UTF-8, which the format asks for even where a name is ASCII."""

MADE_BY = 0x003F
"""Version 6.3 of ZIP, on a file system without attributes."""

_END = struct.Struct("<4s4H2IH")
_CENTRAL = struct.Struct("<4s6H3I5H2I")


def write_u3ma(path: Path, files: Sequence[Path]) -> Path:
    """Write `files`, which lie in the folder of `path` or below it, as an archive; return `path`.

    Raises FabricError for another suffix, and for files that are too large for ZIP without its
    extension to 64 bits.
    """
    if path.suffix != ".u3ma":
        raise FabricError(str(path), "is not the name of a U3M archive; it must end in .u3ma")
    now = datetime.now(UTC).timetuple()[:6]
    with whole_file(path) as temporary:
        try:
            with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, allowZip64=False) as archive:
                for file in files:
                    name = file.relative_to(path.parent).as_posix()
                    entry = zipfile.ZipInfo(name, now)
                    entry.compress_type = zipfile.ZIP_DEFLATED
                    archive.writestr(entry, file.read_bytes())
        except zipfile.LargeZipFile as error:
            raise FabricError(str(path), f"is too large for a U3M archive: {error}") from error
        data = bytearray(temporary.read_bytes())
        _restrict(data)
        temporary.write_bytes(data)
    return path


def _restrict(data: bytearray) -> None:
    """Set the flags and drop the attributes of all entries of an archive without a comment."""
    *_, count, _, place, _ = _END.unpack_from(data, len(data) - _END.size)
    for _ in range(count):
        record = list(_CENTRAL.unpack_from(data, place))
        _, _, _, flags, *_ = record
        record[1], record[3], record[14], record[15] = MADE_BY, flags | UTF8, 0, 0
        _CENTRAL.pack_into(data, place, *record)
        local = record[16]
        struct.pack_into("<H", data, local + 6, flags | UTF8)
        place += _CENTRAL.size + record[10] + record[11] + record[12]
