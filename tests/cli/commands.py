"""Running a command in this process, as a person would type it."""

from __future__ import annotations

from fabricusd.cli.main import main


def run(capsys, *arguments: str) -> tuple[int, str, str]:
    """(status, stdout, stderr) of `fabricusd ARGUMENTS`."""
    try:
        status = main(arguments)
    except SystemExit as stop:
        status = int(stop.code or 0)
    out, err = capsys.readouterr()
    return status, out, err
