"""Open the stage that a user names: a file, a file with a prim path, or a preset."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pxr import Sdf, Tf, Usd, UsdUtils

from fabricusd.errors import FabricError, did_you_mean, one_line, reads
from fabricusd.files import readable_file
from fabricusd.schema.access import kind_of, type_of
from fabricusd.weaves.knits import knitted

PRESETS = Path(__file__).resolve().parent / "presets"
"""Layers of the published fabrics and threads, and of what is derived from their sources."""

TRADE = PRESETS / "trade"
"""Layers of cloth of the trade, which `python -m fabricusd.presets` makes."""

PARSER_WORDS = {
    r"parse error matching \S.*? at '": "does not parse at '",
    r"Error parsing \w+ value: Failed .*?\(at sub-part .*?\) at ": "no value of its type: ",
}
"""Patterns of what USD's text parser says, and plain words to replace each of them with."""


def preset_names() -> list[str]:
    """Return the names of the fabrics that come with the package."""
    return sorted([*published_names(), *(path.stem for path in TRADE.glob("*.usda"))])


def published_names() -> list[str]:
    """The names of those that rest on the fabrics of [Bisker2011] and [Sadeghi2013].

    Tables that were measured per preset (the choice of methods, figures of tubes, medians of
    shares by side) have these alone.
    """
    return sorted(path.stem for path in PRESETS.glob("*.usda"))


VARIANTS = re.compile(r"(?:\{[^{}=]*=[^{}=]*\})+$")
"""What chooses variants at the end of a source."""


def preset_path(name: str) -> Path:
    """The layer of a preset, which need not exist."""
    folder = TRADE if (TRADE / f"{name}.usda").exists() else PRESETS
    return folder / f"{name}.usda"


def preset_hint(name: str) -> str:
    """What to say of a name that no preset has: that it is a knit, what was meant, or ""."""
    if knit := knitted(name):
        return f"; it {knit}"
    known = preset_names()
    within = [each for each in known if name and name.lower() in each]
    return f" (did you mean '{within[0]}'?)" if within else did_you_mean(name, known)


def split_source(source: str | os.PathLike[str]) -> tuple[Path, str]:
    """`FILE[:/PRIM][{SET=VARIANT}...]`, or a preset's name for FILE -> (file, prim path or "")."""
    text = _split_variants(source)[0]
    file, separator, prim = text.rpartition(":/")
    # The part of `C:/cloth.usda` before the `:` is a drive, not a file.
    if not separator or (len(file) == 1 and file.isalpha()):
        file, separator = text, ""
    if not file:
        raise FabricError(repr(text), "does not name a file; it must name a USD file or a preset")
    prim = f"/{prim}" if separator else ""
    if not os.path.exists(file) and file in preset_names():
        return preset_path(file), prim
    return Path(file), prim


def variants_of(source: str | os.PathLike[str]) -> tuple[tuple[str, str], ...]:
    """(set, variant) of each `{SET=VARIANT}` at the end of `source`, as USD's paths write it."""
    return _split_variants(source)[1]


def _split_variants(source: str | os.PathLike[str]) -> tuple[str, tuple[tuple[str, str], ...]]:
    text = os.fspath(source)
    found = VARIANTS.search(text)
    if found is None or os.path.exists(text):
        return text, ()
    chosen = (one.partition("=") for one in found.group()[1:-1].split("}{"))
    return text[: found.start()], tuple((name, variant) for name, _, variant in chosen)


@reads("USD")
def open_stage(source: str | os.PathLike[str]) -> tuple[Usd.Stage, str]:
    """Open the stage of a file or a preset, with every composition error raised.

    Variants that the source chooses are selected in the session layer. Returns (stage, the name to
    use in messages). Raises FabricError where the file is missing, empty, not USD, or does not
    compose, and where the fabric has no such variant.
    """
    path, prim_path = split_source(source)
    missing = "does not exist"
    if not path.suffix:
        hint = preset_hint(str(path))
        missing = f"is neither a file nor a preset{hint}"
        if not knitted(str(path)):
            missing += f"; presets are {', '.join(preset_names())}"
    readable_file(path, missing=missing)
    with usd_errors(str(path)):
        if Sdf.FileFormat.FindByExtension(str(path)) is None:
            raise FabricError(str(path), "is not USD; it must be .usda, .usdc, .usd or .usdz")
        stage = compose_stage(str(path))
        for which, variant in variants_of(source):
            _select(find_fabric(stage, str(path), prim_path), which, variant, str(path))
        errors = stage.GetCompositionErrors()
        if errors:
            raise FabricError(str(path), f"does not compose: {one_line(str(errors[0]), 300)}")
    return stage, str(path)


@reads("USD")
def refuse_other_layers(path: str | os.PathLike[str]) -> None:
    """Raise FabricError for USD text that names other layers, or clips, and so would read them."""
    file = os.fspath(path)
    readable_file(file)
    with usd_errors(file), no_warnings():
        layer = Sdf.Layer.CreateAnonymous(".usda")
        layer.ImportFromString(Path(file).read_text("utf-8"))
        named = [*layer.subLayerPaths, *layer.GetCompositionAssetDependencies()]

        def look(at: Sdf.Path) -> None:
            spec = layer.GetObjectAtPath(at)
            if isinstance(spec, Sdf.PrimSpec) and spec.HasInfo("clips"):
                named.append("its clips")

        layer.Traverse(Sdf.Path.absoluteRootPath, look)
    # An empty name is that of the layer itself.
    if named := [name for name in named if name]:
        raise FabricError(
            file, f"refers to '{one_line(str(named[0]), 80)}'; it must hold all of the fabric"
        )


def variant_sources(source: str | os.PathLike[str]) -> list[str]:
    """`source` with each variant of the fabric's sets chosen in turn; FabricError without any.

    Raises FabricError as `open_stage`.
    """
    stage, file = open_stage(source)
    sets = find_fabric(stage, file, split_source(source)[1]).GetVariantSets()
    found = [
        f"{os.fspath(source)}{{{name}={variant}}}"
        for name in sets.GetNames()
        for variant in sets.GetVariantSet(name).GetVariantNames()
    ]
    if not found:
        raise FabricError(os.fspath(source), "has no variants")
    return found


def holds(source: str | os.PathLike[str], kind: str) -> bool:
    """Whether the stage of `source` has a prim of this type; FabricError as `open_stage`."""
    # Prims expire with their stage.
    stage, _ = open_stage(source)
    every = Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    return any(prim.GetTypeName() == kind for prim in every)


def _select(prim: Usd.Prim, which: str, variant: str, file: str) -> None:
    """Select a variant of `prim` in the session layer of its stage."""
    where = f"{file}:{prim.GetPath()}{{{which}={variant}}}"
    sets = prim.GetVariantSets()
    if not sets.HasVariantSet(which):
        known = ", ".join(sets.GetNames()) or "none"
        raise FabricError(where, f"has no variant set '{which}'; the fabric's sets are: {known}")
    names = sets.GetVariantSet(which).GetVariantNames()
    if variant not in names:
        raise FabricError(
            where, f"has no variant '{variant}'; it must be one of {', '.join(names)}"
        )
    stage = prim.GetStage()
    with Usd.EditContext(stage, stage.GetSessionLayer()):
        sets.GetVariantSet(which).SetVariantSelection(variant)


def compose_stage(path: str) -> Usd.Stage:
    """Open the stage of a file as it is on disk now; the caller looks at composition errors."""
    # USD also prints them as warnings.
    with no_warnings():
        layer = Sdf.Layer.FindOrOpen(path)
        if layer is None:
            raise FabricError(path, "is not USD; it cannot be parsed")
        stage = Usd.Stage.Open(layer)
        for used in stage.GetUsedLayers():
            # The process may hold an older reading of the file. Unsaved edits are kept. Reloading
            # one layer may have released another.
            if not used.expired and not used.dirty and not used.anonymous:
                used.Reload()
        return stage


@contextmanager
def no_warnings() -> Iterator[None]:
    """Keep USD from printing warnings in the block."""
    silence = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        silence.TakeUncoalescedDiagnostics()
        del silence


@reads("USD")
def flattened(source: str | os.PathLike[str]) -> str:
    """The composed stage of `source` as USD text; FabricError as from `open_stage`."""
    stage, file = open_stage(source)
    find_prim(stage, file, split_source(source)[1] or "/")
    with usd_errors(file, "flattened"):
        return str(stage.Flatten().ExportToString())


@contextmanager
def usd_errors(where: str, doing: str = "parsed as USD") -> Iterator[None]:
    """Turn what USD raises in the block into a FabricError of one line; `where` is the file."""
    try:
        try:
            yield
        except Tf.ErrorException as error:
            raise FabricError(where, f"cannot be {doing}: {_usd_words(error)}") from error
    except UnicodeEncodeError as error:
        raise FabricError(where, "has a name that is not UTF-8; USD needs a UTF-8 name") from error
    except UnicodeDecodeError as error:
        byte = f"the byte {error.object[error.start]:#04x}{_line_of_byte(where)}"
        raise FabricError(where, f"holds {byte}; its text must be UTF-8") from error


def _usd_words(error: Tf.ErrorException) -> str:
    """Return what is wrong, without names of USD's source code.

    Raises UnicodeDecodeError where USD's message is not text.
    """
    reports = [one.commentary for one in error.args] or [str(error)]
    # USD reports a value that does not parse twice; the second report says where it is.
    words = next((each for each in reports if re.search(r":[0-9]+:[0-9]+: ", each)), reports[0])
    for riddle, plain in PARSER_WORDS.items():
        words = re.sub(riddle, plain, words)
    return one_line(words, 300)


def _line_of_byte(file: str) -> str:
    """Return ` in line 7` for a text layer's first byte that is not UTF-8, or ""."""
    try:
        data = Path(file).read_bytes()
        if data.startswith(b"#usda"):
            data.decode()
    except UnicodeDecodeError as error:
        return f" in line {data.count(bytes([10]), 0, error.start) + 1}"
    except OSError:
        pass
    return ""


def find_prim(stage: Usd.Stage, file: str, prim_path: str) -> Usd.Prim:
    """The prim at `prim_path`, of any type; FabricError where there is none."""
    if not Sdf.Path.IsValidPathString(prim_path):
        raise FabricError(f"{file}:{prim_path}", "is not a prim path")
    prim = stage.GetPrimAtPath(prim_path)
    if not prim:
        raise FabricError(f"{file}:{prim_path}", "does not exist; it must be a prim of the file")
    return prim


def find_fabric(stage: Usd.Stage, file: str, prim_path: str = "") -> Usd.Prim:
    """The WovenFabric prim at `prim_path`; by default the default prim, or the only one."""
    if prim_path:
        prim = find_prim(stage, file, prim_path)
        if type_of(prim) != "WovenFabric":
            raise FabricError(
                f"{file}:{prim_path}", f"is {kind_of(prim)}; it must be a WovenFabric"
            )
        return prim
    default = stage.GetDefaultPrim()
    if default and type_of(default) == "WovenFabric":
        return default
    every = Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    found = []
    walk = iter(every)
    for prim in walk:
        if type_of(prim) == "WovenFabric":
            found.append(prim)
            # A fabric below is its back.
            walk.PruneChildren()
    if not found:
        raise FabricError(file, "has no WovenFabric prim")
    if len(found) > 1:
        names = ", ".join(f"{file}:{prim.GetPath()}" for prim in found[:8])
        raise FabricError(file, f"holds {len(found)} fabrics; name one of {names}")
    return found[0]
