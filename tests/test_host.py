"""No USD, a USD that is too old, and two USDs at once: one line each."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fabricusd import FabricError
from fabricusd.host import FLOOR, NoUsd, in_words, require_version, two_meet

ROOT = Path(__file__).parents[1]

WITHOUT_USD = """
import sys
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name == "pxr":
            raise ModuleNotFoundError("No module named 'pxr'", name="pxr")
sys.meta_path.insert(0, Hidden())
"""


def in_a_new_process(script: str, *paths: Path) -> subprocess.CompletedProcess[str]:
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (ROOT, *paths)))}
    return subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, env=variables, check=False
    )


SCENE = ROOT / "tests" / "cases" / "usd_subset_false_note" / "subset.usda"
COMMANDS = {
    "check": ["check", "linen_plain"],
    "cat": ["cat", "linen_plain"],
    "render": ["render", str(SCENE), "-o", "x.exr"],
    "bake": ["bake", str(SCENE), "-o", "baked"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_without_usd_says_what_to_install(command, tmp_path):
    program = f"import os; os.chdir({str(tmp_path)!r}); from fabricusd.cli.program import program"
    words = ["fabricusd", *COMMANDS[command]]
    done = in_a_new_process(f"{WITHOUT_USD}{program}; sys.argv = {words!r}; program()")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert list(tmp_path.iterdir()) == []
    assert "pxr is not installed; pip install 'fabricusd[usd]'" in line


def test_the_package_without_usd_raises_what_scripts_catch():
    for caught in ("ImportError", "ValueError"):
        script = f"try:\n    import fabricusd.schema\nexcept {caught} as e:\n    print(e)"
        assert "fabricusd[usd]" in in_a_new_process(WITHOUT_USD + script).stdout


@pytest.mark.parametrize("version", [(0, 24, 5), (0, 23, 11)])
def test_a_usd_below_the_floor_is_refused(version):
    with pytest.raises(NoUsd, match=f"needs USD {in_words(FLOOR)} or newer") as caught:
        require_version(version)
    assert isinstance(caught.value, FabricError)
    require_version((0, *FLOOR))
    require_version((0, 25, 5))


def test_one_usd_is_none_too_many():
    assert two_meet() == ""


def test_two_usds_are_told_in_one_line_and_named(tmp_path):
    host = tmp_path / "host"
    (host / "pxr").mkdir(parents=True)
    (host / "pxr" / "__init__.py").write_text("")
    # The host's copy is behind usd-core on the path.
    after = (
        f"import sys; sys.path.append({str(host)!r}); sys.argv = ['fabricusd', 'check', 'velvet']"
    )
    done = in_a_new_process(f"{after}\nfrom fabricusd.cli.program import program\nprogram()")
    first, *_ = done.stderr.splitlines()
    assert done.returncode == 0
    assert first.startswith("fabricusd: two USDs meet: pxr is imported from")
    assert str(host / "pxr") in first
    # And before it: nothing of it is imported here, but the order is told.
    before = "from fabricusd.host import two_meet\nprint(two_meet())"
    line = in_a_new_process(before, host).stdout
    assert line.startswith(f"two USDs meet: pxr is imported from {host / 'pxr'}, which hides ")
    assert "usd-core" in line
