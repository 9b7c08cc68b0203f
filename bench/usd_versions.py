"""What works with which USD: one environment for each version, and one table of all of them.

    python bench/usd_versions.py --versions 24.11 25.5 25.11 26.11

makes an environment for each version below `build/usd-versions`, with this checkout and all that it
needs, tries each thing in a process of its own, and writes docs/usd_versions.md. Status 1 where
anything fails.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "usd_versions.md"
PLUGIN = ROOT / "fabricusd" / "schema" / "plugin"
PRESETS = ROOT / "fabricusd" / "schema" / "presets"
BAD = ROOT / "tests" / "schema" / "bad"

TYPED = """
import sys; sys.modules["fabricusd"] = None
from pathlib import Path
from pxr import Usd
count = 0
for path in sorted(Path(sys.argv[1]).glob("*.usda")):
    stage = Usd.Stage.Open(str(path))
    prims = [p for p in stage.Traverse() if str(p.GetTypeName()).startswith("Woven")]
    assert prims and all(p.IsA(Usd.Typed) for p in prims), path
    # Not authored in any preset: the schema's fallback.
    assert all(p.GetAttribute("thread:surfaceGain").Get() is not None
               for p in prims if p.GetTypeName() == "WovenThread"), path
    count += 1
print(f"{count} presets")
"""
LOAD = """
import hashlib, json, sys, tempfile
from pathlib import Path
from fabricusd.schema import load, published_names
from fabricusd.schema.describe import as_dict
fabrics = [load(name) for name in published_names()]
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder, "aces.usda")
    path.write_text(sys.argv[1])
    fabrics.append(load(path))
text = json.dumps([as_dict(fabric) for fabric in fabrics], sort_keys=True)
print(f"{len(published_names())} presets, digest {hashlib.sha256(text.encode()).hexdigest()[:8]}")
"""
CHECK = """
import sys
from pathlib import Path
from fabricusd.schema import check, published_names
from fabricusd.schema.rules.rules import RULES
for name in published_names():
    assert check(name) == [], (name, check(name))
for rule in RULES:
    found = check(Path(sys.argv[1]) / f"{rule.function.__name__}.usda")
    assert rule.name in {f.rule for f in found}, rule.name
print(f"{len(RULES)} rules")
"""
VALIDATORS = """
import sys
from pxr import Usd
from fabricusd.host import VALIDATORS_FROM, in_words
if Usd.GetVersion()[1:] < VALIDATORS_FROM:
    print(f"needs USD {in_words(VALIDATORS_FROM)}")
    raise SystemExit
from pxr import UsdValidation
stage = Usd.Stage.Open(sys.argv[1] + "/number_in_range.usda")
validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
names = {e.GetName() for e in UsdValidation.ValidationContext(validators).Validate(stage)}
assert "NumberInRange" in names, names
print("found")
"""
RENDER = """
import hashlib, sys, tempfile
from pathlib import Path
import numpy as np
from fabricusd.reference import render
with tempfile.TemporaryDirectory() as folder:
    scene = Path(folder, "scene.usda")
    scene.write_text(sys.argv[1])
    made = render(scene, None, width=64, height=64, spp=4)
assert made.notes == (), made.notes
beauty = np.asarray(made.layers["beauty"], np.float64)
assert np.isfinite(beauty).all()
print(f"mean {beauty[..., :3].mean():.6f}")
"""
ACES = """#usda 1.0
def Scope "World" (
    prepend apiSchemas = ["ColorSpaceAPI"]
)
{
    uniform token colorSpace:name = "lin_ap1_scene"
    def WovenFabric "Cloth"
    {
        def WovenThread "Thread"
        {
            color3d thread:albedo = (0.3, 0.2, 0.15)
        }
    }
}
"""
SCENE = f"""#usda 1.0
(
    metersPerUnit = 1
)
def WovenFabric "Linen" (
    references = @{PRESETS / "linen_plain.usda"}@
)
{{
}}
def Mesh "Sheet" (
    prepend apiSchemas = ["WovenBindingAPI"]
)
{{
    rel fabric:binding = </Linen>
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (
        interpolation = "vertex"
    )
    uniform token subdivisionScheme = "none"
}}
def Camera "Front"
{{
    float focalLength = 20
    double3 xformOp:translate = (0, 0, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def DistantLight "Sun"
{{
    float inputs:intensity = 3
    bool inputs:normalize = 1
}}
"""

# Column -> (script, its arguments, the folders of PXR_PLUGINPATH_NAME).
TRIES: dict[str, tuple[str, list[str], list[Path]]] = {
    "presets typed, plugin path alone": (TYPED, [str(PRESETS)], [PLUGIN]),
    "`load`": (LOAD, [ACES], []),
    "`check`": (CHECK, [str(BAD)], []),
    "rules in USD's validation": (VALIDATORS, [str(BAD)], [PLUGIN, PLUGIN / "validators"]),
    "`render`": (RENDER, [SCENE], []),
}


def environment(folder: Path, version: str) -> Path:
    """The Python of an environment with one USD; made where it is not there yet."""
    python = folder / version / "bin" / "python"
    stamp = folder / version / "installed"
    if not stamp.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder / version)], check=True)
        packages = ["--editable", str(ROOT), f"usd-core=={version}"]
        subprocess.run([str(python), "-m", "pip", "install", "--quiet", *packages], check=True)
        stamp.touch()
    return python


def attempt(python: Path, script: str, arguments: list[str], plugins: list[Path]) -> str:
    """What a script prints, or `fails: ` and the last line of its traceback."""
    variables = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    variables["PXR_PLUGINPATH_NAME"] = os.pathsep.join(map(str, plugins))
    done = subprocess.run(
        [str(python), "-c", script, *arguments],
        capture_output=True, text=True, env=variables, cwd=ROOT, check=False,
    )  # fmt: skip
    if done.returncode == 0:
        return done.stdout.strip()
    lines = done.stderr.strip().splitlines() or [f"status {done.returncode}"]
    return f"fails: {lines[-1][:160]}"


def page(rows: dict[str, dict[str, str]]) -> str:
    """The table as Markdown."""
    lines = [
        "# Versions of USD",
        "",
        "Made by `python bench/usd_versions.py --versions " + " ".join(rows) + "`: one environment",
        "for each version of `usd-core`. *Typed*: plain USD with `PXR_PLUGINPATH_NAME` and without",
        "fabricusd opens every preset with types and fallbacks. *Digest*: of every number that is",
        "read, of the presets and of a fabric in ACES colours. *Mean*: of a picture of 64x64",
        "pixels, 4 samples each.",
        "",
        "| USD | " + " | ".join(TRIES) + " |",
        "|---|" + "---|" * len(TRIES),
    ]
    for version, row in rows.items():
        cells = (row[name].replace("|", "\\|") for name in TRIES)
        lines.append(f"| {version} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Make the environments and the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--versions", nargs="+", required=True, metavar="VERSION")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "usd-versions")
    parser.add_argument("--output", type=Path, default=PAGE)
    options = parser.parse_args()
    rows = {}
    for version in options.versions:
        python = environment(options.folder, version)
        rows[version] = {name: attempt(python, *each) for name, each in TRIES.items()}
        print(json.dumps({version: rows[version]}), flush=True)
    options.output.write_text(page(rows))
    return int(any(cell.startswith("fails") for row in rows.values() for cell in row.values()))


if __name__ == "__main__":
    raise SystemExit(main())
