"""The program as a whole process: its status, and that nothing written is lost at its quick end."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = str(Path(__file__).resolve().parents[2])

AS_PROGRAM = """
import atexit, sys
from fabricusd.cli.program import program
atexit.register(print, "told of the end")
sys.argv[1:] = {arguments}
program()
"""


def run(*arguments: str, stdout):
    # Unbuffered, argparse itself meets a full disk, and says nothing.
    environment = {**os.environ, "PYTHONPATH": ROOT, "PYTHONUNBUFFERED": ""}
    return subprocess.run(
        [sys.executable, *arguments], env=environment, stdout=stdout, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip


def start(*arguments: str):
    script = AS_PROGRAM.format(arguments=list(arguments))
    return run("-c", script, stdout=subprocess.PIPE)


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (("cat", "linen_plain"), 0),
        (("--help",), 0),
        (("cat", "no_such_fabric"), 2),
        (("cat", "--no-such-option"), 2),
    ],
)
def test_status_is_that_of_the_command(arguments, status):
    done = start(*arguments)
    assert done.returncode == status
    assert len(done.stderr.splitlines()) == (1 if status else 0)


def test_all_that_was_printed_arrives_also_from_who_asked_to_be_told_of_the_end():
    printed = start("cat", "linen_plain").stdout
    assert printed.startswith("linen_plain: ")
    assert printed.endswith("\ntold of the end\n")


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has /dev/full")
def test_a_full_disk_is_said_in_one_line():
    with open("/dev/full", "w") as full:
        done = run("-m", "fabricusd", "--help", stdout=full)
    assert done.returncode == 2
    assert done.stderr == "fabricusd: the output cannot be written: No space left on device\n"
