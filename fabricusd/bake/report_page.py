"""The report of a bake as a page that can be sent to whoever asked for the garment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

STYLE = """
:root{color-scheme:light}
body{font:16px/1.55 system-ui,sans-serif;margin:0 auto;padding:1.5rem 1rem 4rem;max-width:64rem;
color:#1d1d1f;background:#fff}
h1{font-size:1.7rem;line-height:1.2;margin:0 0 .3rem}
h2{font-size:1.2rem;margin:2.4rem 0 .6rem;padding-top:.6rem;border-top:1px solid #ddd}
h3{font-size:1rem;margin:1.4rem 0 .4rem}
p,ul{max-width:46rem}
.lead{color:#555;margin:0 0 1.2rem}
.hero{display:block;width:100%;height:auto;border-radius:6px}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-size:.9rem;font-variant-numeric:tabular-nums}
td,th{padding:.3rem .9rem .3rem 0;text-align:left;vertical-align:top;
border-bottom:1px solid #e4e4e4}
th{font-weight:600}
.maps{display:grid;grid-template-columns:repeat(auto-fill,minmax(10.5rem,1fr));gap:1.2rem 1rem}
figure{margin:0;font-size:.82rem;line-height:1.4;overflow-wrap:anywhere}
figure img{display:block;width:100%;aspect-ratio:1;image-rendering:pixelated;box-sizing:border-box;
border:1px solid #bbb;background:#9a9a9a}
.ground{padding:.7rem;background:#9a9a9a;border-radius:6px}
.scale{display:flex;gap:.4rem;align-items:center;margin:.3rem 0 .1rem}
.scale i{flex:1;height:.7rem;border:1px solid #bbb;background:linear-gradient(90deg,#000,#fff)}
figcaption b{display:block;margin-top:.3rem}
.meaning{color:#555}
details{margin-top:1rem}summary{cursor:pointer;font-weight:600}
"""


def page_of(said: Mapping[str, Any], figures: Mapping[str, list[str]], portrait: str) -> str:
    """The page, whole.

    said : what report.json holds; figures : `figure` of each map, by garment; portrait : file of
        the garment's picture, "" for none
    """
    scene, cost = said["scene"], said["cost"]
    names = ", ".join(one["name"] for one in said["fabrics"])
    asked = said["asked"]["max_error"]
    lead = (
        f"{cost['resolution']} × {cost['resolution']} texels, {cost['bytes'] / 1e6:.1f} MB, baked "
        f"in {cost['seconds']:.1f} s"
        + ("" if asked is None else f"; the bound asked for is ΔE {asked:g}, ")
        + ("" if asked is None else "which is met" if said["within"] else "which is not met")
    )
    parts = [
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(scene)}: bake</title><style>{STYLE}</style>"
        f'<h1>{escape(scene)} in {escape(names)}</h1><p class="lead">{escape(lead)}.</p>'
    ]
    if portrait:
        parts.append(
            f'<img class="hero" src="{escape(portrait)}" alt="Preview of {escape(scene)}">'
        )
    parts += [_garments(said), _fabrics(said), _error(said)]
    for garment, each in figures.items():
        what = f" of {escape(garment)}" if len(figures) > 1 else ""
        parts.append(
            f"<h2>Maps{what}</h2><p>Each picture is the fullest part of the texture at its finest "
            "level, one texel per pixel, in the range that its legend states.</p>"
            f'<div class="maps">{"".join(each)}</div>'
        )
    parts += [_btf(said), _tried(said), _map_errors(said)]
    if said["notes"]:
        notes = "".join(f"<li>{escape(note)}" for note in said["notes"])
        parts.append(f"<h2>Notes</h2><ul>{notes}</ul>")
    return "".join(parts) + "</html>\n"


def figure(file: str, name: str, meaning: str, legend: str, ends: tuple[str, str] | None) -> str:
    """One map: its picture, the scale of its greys if it has one, and its words."""
    scale = (
        f'<div class="scale"><span>{escape(ends[0])}</span><i></i><span>{escape(ends[1])}</span>'
        "</div>"
        if ends
        else f"<div>{escape(legend)}</div>"
    )
    return (
        f'<figure><div class="ground"><img src="{escape(file)}" alt="map {escape(name)}"></div>'
        f"<figcaption><b>{escape(name)}</b>{scale}"
        f'<span class="meaning">{escape(meaning)}</span></figcaption></figure>'
    )


def _table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table that scrolls by itself where the window is narrower."""
    head = "".join(f"<th>{escape(one)}" for one in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(c)}" for c in row) for row in rows)
    return f'<div class="scroll"><table><tr>{head}{body}</table></div>'


def _garments(said: Mapping[str, Any]) -> str:
    return "<h2>Garment</h2>" + _table(
        ("garment", "size", "triangles", "fabric", "UVs"),
        (
            (
                one["name"],
                " × ".join(f"{100 * side:.0f}" for side in one["size"]) + " cm",
                f"{one['triangles']:,}",
                ", ".join(one["fabrics"]),
                "the scene's" if one["own_uv"] else "moved or made by the bake",
            )
            for one in said["garments"]
        ),
    )


def _fabrics(said: Mapping[str, Any]) -> str:
    return "<h2>Fabric</h2>" + _table(
        ("fabric", "weave", "ends per cm", "picks per cm", "texels per thread", "model"),
        (
            (
                one["name"],
                one["weave"],
                f"{one['ends_per_cm']:.3g}",
                f"{one['picks_per_cm']:.3g}",
                " × ".join(f"{texels:.2g}" for texels in one["texels_per_thread"]),
                one["model"],
            )
            for one in said["fabrics"]
        ),
    )


def _error(said: Mapping[str, Any]) -> str:
    """The errors, and why the two figures differ."""
    reached = said["reached"]
    behind = any(e["behind"] is not None for e in reached.values())
    heads = ["garment", "over texels", "at points", "stated bound"]
    rows = (
        [name, f"{e['texel']:.2f}", f"{e['point']:.2f}", f"{e['bound']:.2f}"]
        + ([] if not behind else ["" if e["behind"] is None else f"{e['behind']:.2f}"])
        for name, e in reached.items()
    )
    return (
        "<h2>Error</h2><p>The maps are re-lit under 32 pairs of light and view, and compared with "
        "the fabric's model as ΔE 2000: below 1 is hardly visible, 5 is plain to see.</p>"
        + _table([*heads, *(["lit from behind"] if behind else [])], rows)
        + "<ul><li><b>Over texels</b>: against the mean of the cloth that each texel covers. This "
        "is the error of the colour that a renderer shows.<li><b>At points</b>: against single "
        "points of the cloth. A texel wider than the detail of a thread holds a mean, and a point "
        f"is not the mean.{_why(said)} It falls with the resolution.<li><b>Stated bound</b>: twice "
        "the worst pair of directions over texels."
        + (
            "<li><b>Lit from behind</b>: over texels, with the lights behind the cloth."
            if behind
            else ""
        )
        + "</ul>"
    )


def _why(said: Mapping[str, Any]) -> str:
    """What the figures at points say of this bake, where they are far above those of texels."""
    name, worst = max(said["reached"].items(), key=lambda item: item[1]["point"])
    texels = min(min(one["texels_per_thread"]) for one in said["fabrics"])
    if worst["point"] < 2 * worst["texel"] or worst["point"] < 1:
        return ""
    return (
        f" So {worst['point']:.0f} at points beside {worst['texel']:.1f} over texels, on "
        f"{escape(name)}, is no error of colour: at {texels:.2g} texels per thread, the texture is "
        "too coarse to show single threads from near by."
    )


def _btf(said: Mapping[str, Any]) -> str:
    rows = [
        (
            fabric, r["form"], f"{r['megabytes']:.2f}", str(max(r["rank"])),
            f"{r['delta_e']:.2f}", f"{r['delta_e_between']:.2f}", f"{r['bound']:.2f}",
        )
        for fabric, records in said["btf"].items()
        for r in records
    ]  # fmt: skip
    heads = ("fabric", "form", "MB", "rank", "ΔE", "between directions", "stated bound")
    return f"<h2>BTF</h2>{_table(heads, rows)}" if rows else ""


def _tried(said: Mapping[str, Any]) -> str:
    rows = [
        (str(t["resolution"]), str(len(t["maps"])), f"{t['megabytes']:.2f}", f"{t['point']:.2f}")
        for t in said["tried"]
    ]
    heads = ("texels along a side", "maps to re-light", "MB", "ΔE at points")
    return f"<h2>Trials</h2>{_table(heads, rows)}" if rows else ""


def _map_errors(said: Mapping[str, Any]) -> str:
    heads = (
        "garment", "map", "unit", "of the number type", "over texels", "at points",
        "deviation of the map",
    )  # fmt: skip
    rows = (
        (
            garment, name, e["unit"], f"{e['rounding']:.2g}", f"{e['texel']:.2g}",
            f"{e['point']:.2g}", f"{e['spread']:.2g}",
        )
        for garment, maps in said["map_error"].items()
        for name, e in maps.items()
    )  # fmt: skip
    return (
        "<details><summary>Error of each map</summary><p>Root mean squares in the map's own unit. "
        "The last column is how much the map varies, to judge the others by.</p>"
        f"{_table(heads, rows)}</details>"
    )
