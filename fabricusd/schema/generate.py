"""Make the plugin folder, which other tools are pointed at: from `schema.usda`, models and rules.

`python -m fabricusd.schema.generate` writes them, `--check` only compares. A developer's step: it
needs jinja2, which usdGenSchema uses.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from fabricusd.fabric import BASES, MODELS, OBSERVERS, SURFACE_LAWS
from fabricusd.schema.attributes import Attribute, every_attribute, unscale

HERE = Path(__file__).resolve().parent
PLUGIN = HERE / "plugin"


def _name_models(layer: Any) -> None:
    """Write the names of models and laws, and what each is, into the properties that choose
    one."""
    from fabricusd.appearance.laws import law_summary
    from fabricusd.appearance.scattering.models import named

    fabric = layer.GetAttributeAtPath("/WovenFabric.fabric:model")
    thread = layer.GetAttributeAtPath("/WovenThread.thread:model")
    fabric.allowedTokens, thread.allowedTokens = MODELS, ("inherit", *MODELS)
    thread = layer.GetAttributeAtPath("/WovenThread.thread:targetColor:basis")
    thread.allowedTokens = BASES
    thread = layer.GetAttributeAtPath("/WovenThread.thread:targetColor:observer")
    thread.allowedTokens = [str(field) for field in OBSERVERS]
    meaning = " ".join(f"{name}: {named(name).summary}." for name in MODELS)
    fabric.documentation = fabric.documentation.replace("Unit:", f"{meaning} Unit:")
    law = layer.GetAttributeAtPath("/WovenFabric.fabric:surfaceLaw")
    law.allowedTokens = SURFACE_LAWS
    meaning = " ".join(f"{name}: {law_summary(name)}." for name in SURFACE_LAWS)
    law.documentation = law.documentation.replace("Unit:", f"{meaning} Unit:")


def _whole_source(folder: Path) -> Path:
    """A copy of schema.usda that names the models, and in which every property's user doc is its
    whole documentation.

    usdGenSchema would keep the first sentence alone, and the unit would be lost to usdview.
    """
    from pxr import Sdf

    layer = Sdf.Layer.FindOrOpen(str(HERE / "schema.usda"))
    copy = Sdf.Layer.CreateAnonymous(".usda")
    copy.TransferContent(layer)
    _name_models(copy)

    def keep_docs(path: Sdf.Path) -> None:
        spec = copy.GetObjectAtPath(path)
        if isinstance(spec, (Sdf.PropertySpec, Sdf.PrimSpec)) and spec.documentation:
            one_line = " ".join(spec.documentation.split())
            spec.customData = {**dict(spec.customData), "userDocBrief": one_line}

    copy.Traverse(Sdf.Path.absoluteRootPath, keep_docs)
    target = folder / "schema.usda"
    copy.Export(str(target))
    return target


def _finished(made: Path, source: Path) -> str:
    """The text of usdGenSchema's layer with each attribute's unit and bounds, which it leaves out.

    Bounds are USD's `limits`, in the unit of the file; an open bound is written as the closed one
    nearest to it, which `limits` have alone. USD before 25.11 passes over them.
    """
    from pxr import Sdf

    layer, written = (Sdf.Layer.FindOrOpen(str(path)) for path in (made, source))
    bounds = {entry.name: _limits(entry) for entry in every_attribute()}
    for prim in layer.rootPrims:
        for spec in prim.attributes:
            unit = written.GetObjectAtPath(spec.path).customData.get("unit")
            if unit:
                spec.customData = {**dict(spec.customData), "unit": unit}
            if bounds.get(spec.name):
                spec.SetInfo("limits", bounds[spec.name])
    return str(layer.ExportToString())


def _limits(entry: Attribute) -> dict[str, dict[str, Any]]:
    """USD's `limits` of one attribute: hard ones, and soft ones where a value stands for None."""
    from pxr import Gf

    held = entry.limits
    lo = held.get("minimum") if held.get("above") is None else held["above"]
    hi = held.get("maximum") if held.get("below") is None else held["below"]
    ends = {
        name: unscale(end, entry.scale)
        for name, end in (("minimum", lo), ("maximum", hi))
        if end is not None
    }
    width = {"color3d": Gf.Vec3d, "double2": Gf.Vec2d}.get(entry.type_name)
    if entry.type_name == "int":
        ends = {name: int(end) for name, end in ends.items()}
    shaped = {name: width(*[end] * width.dimension) if width else end for name, end in ends.items()}
    if not shaped:
        return {}
    if entry.sentinel is None:
        return {"hard": shaped}
    return {"hard": {**shaped, "minimum": entry.sentinel}, "soft": shaped}


def generate() -> dict[str, str]:
    """File name -> contents, freshly made."""
    from pxr import Usd

    from fabricusd.schema.rules.rules import RULES

    tool = Path(Usd.__file__).with_name("usdGenSchema.py")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = _whole_source(folder)
        out = folder / "out"
        out.mkdir()
        done = subprocess.run(
            [sys.executable, str(tool), "-q", str(source), str(out)],
            capture_output=True,
            text=True,
        )
        made = out / "generatedSchema.usda"
        if done.returncode or not made.exists():
            raise RuntimeError(f"usdGenSchema failed: {done.stdout}{done.stderr}")
        schema = _finished(made, source)
        info_text = re.sub(r"^#.*\n", "", (out / "plugInfo.json").read_text("utf-8"), flags=re.M)
    plugin = json.loads(info_text)["Plugins"][0]
    plugin.update({"LibraryPath": "", "ResourcePath": ".", "Root": "."})
    validators: dict[str, object] = {"keywords": ["fabricusd"]}
    for rule in RULES:
        types = {"schemaTypes": list(rule.schema_types)} if rule.schema_types else {}
        validators[rule.name] = {"doc": rule.doc, **types}
    python_plugin = {
        "Info": {"Validators": validators},
        "LibraryPath": "",
        "Name": "fabricusd.schema.validators",
        "ResourcePath": ".",
        "Root": ".",
        "Type": "python",
    }
    # USD tells plugins apart by their folder, so the two cannot share one; see `plugin.VALIDATORS`
    # for why only one is included.
    return {
        "plugInfo.json": _json({"Includes": ["fabricusd/"]}),
        "fabricusd/generatedSchema.usda": schema,
        "fabricusd/plugInfo.json": _json({"Plugins": [plugin]}),
        "validators/plugInfo.json": _json({"Plugins": [python_plugin]}),
    }


def _json(value: object) -> str:
    return json.dumps(value, indent=4, sort_keys=True) + "\n"


def main() -> int:
    """Write the files, or with `--check` say which differ."""
    made = generate()
    if "--check" in sys.argv[1:]:
        stale = [
            name
            for name, text in made.items()
            if not (PLUGIN / name).exists() or (PLUGIN / name).read_text("utf-8") != text
        ]
        for name in stale:
            print(f"{name} differs from schema.usda and the rules; run `make schema`")
        return 1 if stale else 0
    for name, text in made.items():
        (PLUGIN / name).parent.mkdir(parents=True, exist_ok=True)
        (PLUGIN / name).write_text(text, "utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
