"""The table of the derived presets. To add one, add a row; run `python -m fabricusd.presets`."""

from __future__ import annotations

from dataclasses import dataclass

INCH, CENTIMETRE = 0.0254, 0.01


@dataclass(frozen=True, kw_only=True)
class Yarn:
    """A set of threads: its count, how it is spun (of `spinning.SPINNING`), its colour, density.

    per : threads in `unit` [m]
    curve : positions and angles [degrees] of the threads' curve; empty for that of `fabricusd new`
    """

    count: str
    spun: str
    color: str
    per: float
    unit: float = INCH
    curve: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())

    @property
    def density(self) -> float:
        """Threads per metre."""
        return self.per / self.unit

    def __str__(self) -> str:
        return f"{self.count}, {self.per:g} per {'inch' if self.unit == INCH else 'cm'}"


@dataclass(frozen=True, kw_only=True)
class Cords:
    """Threads that weave as one, of the yarns of their sets.

    apart, wide : threads from one cord to the next, and in a cord
    angle : at which a cord rises and falls [degrees]
    """

    apart: int
    wide: int
    angle: float
    color: str


@dataclass(frozen=True, kw_only=True)
class Row:
    """One preset.

    is_named : what the cloth is, as the first words of its documentation
    trade : lightest and heaviest that such cloth is sold [g/m2]
    source : where counts, densities and weight come from; what is assumed beyond that
    cords : thicker lines in both sets, if there are any
    is_open : whether more than 3 % of the cloth may be gap
    """

    name: str
    is_named: str
    weave: str
    fibre: str
    warp: Yarn
    weft: Yarn
    trade: tuple[float, float]
    source: str
    cords: Cords | None = None
    is_open: bool = False


def _floating(over: int, angle: float = 20.0) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """A float over some threads: it rises over the first, lies flat, and falls over the last."""
    return (0.0, 1.0, over - 1.0, float(over)), (-angle, 0.0, 0.0, angle)


FLAT = (0.0, 1.0), (-8.0, 8.0)
"""The curve of a thread that is pressed flat."""

ROWS = (
    Row(
        name="cotton_poplin", is_named="Cotton poplin for shirts, white", weave="plain",
        fibre="cotton",
        warp=Yarn(count="Ne 40", spun="combed", color="lab(95, 0, 0)", per=133),
        weft=Yarn(count="Ne 40", spun="combed", color="lab(95, 0, 0)", per=72),
        trade=(110, 125),
        source="Counts and densities are a usual specification of the trade, C 40x40 133x72: "
        "about twice as many ends as picks make the fine cross ribs [AmzPoplin]. The range of "
        "weight is assumed.",
    ),
    Row(
        name="cotton_canvas", is_named="Cotton canvas, ten-ounce duck, unbleached", weave="plain",
        fibre="cotton",
        warp=Yarn(count="Ne 12/2", spun="plied", color="lab(86, 2, 13)", per=52),
        weft=Yarn(count="Ne 12/2", spun="plied", color="lab(86, 2, 13)", per=36),
        trade=(320, 360),
        source="Duck is a close plain weave of plied yarn, sold by weight, of which 10 ounces per "
        "square yard is one [WeavingLibraryDuck]. Counts and densities are assumed such that it "
        "weighs that.",
    ),
    Row(
        name="cotton_sateen", is_named="Cotton sateen for bed linen, ivory",
        weave="satin 5 step 2", fibre="cotton",
        warp=Yarn(count="Ne 60", spun="combed", color="lab(91, 1, 11)", per=173,
                  curve=_floating(4)),
        weft=Yarn(count="Ne 60", spun="combed", color="lab(91, 1, 11)", per=120),
        trade=(110, 135),
        source="Sateen sheets have about 300 threads per square inch, four over and one under "
        "[MatteoSateen]; 173 x 120 of Ne 60 and the range of weight are assumed.",
    ),
    Row(
        name="denim", is_named="Blue denim, warp of indigo, weft unbleached", weave="twill 3/1 Z",
        fibre="cotton",
        warp=Yarn(count="Ne 7", spun="denim", color="#2b3c70", per=72),
        weft=Yarn(count="Ne 10", spun="rotor", color="#e0dccf", per=56),
        trade=(370, 440),
        source="Counts and densities are a typical specification, 7x10 72x56 [DaffodilDenim]; "
        "denim above 11 ounces per square yard counts as heavy there. The right-hand 3/1 twill is "
        "the usual one [RopeDye]. Slubs are assumed.",
    ),
    Row(
        name="chambray", is_named="Cotton chambray for shirts, blue warp and white weft",
        weave="plain", fibre="cotton",
        warp=Yarn(count="Ne 20", spun="carded", color="#46689c", per=80),
        weft=Yarn(count="Ne 20", spun="carded", color="lab(94, 0, 2)", per=76),
        trade=(150, 200),
        source="Plain weave of a dyed warp and a white weft, nearly square, 80 x 76 [Chambray]. "
        "Ne 20, of the range that is spun for chambray [CottonInc1010], and the range of "
        "weight are assumed.",
        is_open=True,
    ),
    Row(
        name="oxford", is_named="Oxford shirting, pale blue ends in pairs over white picks",
        weave="basket 2/1", fibre="cotton",
        warp=Yarn(count="Ne 32", spun="combed", color="#7f9dcb", per=114),
        weft=Yarn(count="Ne 12", spun="soft", color="lab(94, 0, 1)", per=50),
        trade=(150, 200),
        source="Two fine ends travel as one over one thicker, softly spun pick [FabricDictionary]. "
        "Counts, densities and the range of weight are assumed.",
    ),
    Row(
        name="gauze", is_named="Cotton gauze (cheesecloth of grade 90), bleached", weave="plain",
        fibre="cotton",
        warp=Yarn(count="Ne 30", spun="carded", color="lab(93, 0, 3)", per=44),
        weft=Yarn(count="Ne 30", spun="carded", color="lab(93, 0, 3)", per=36),
        trade=(50, 70),
        source="Grade 90 has 44 x 36 threads per inch [Cheesecloth]; Ne 30 and the range of "
        "weight are assumed.",
        is_open=True,
    ),
    Row(
        name="worsted_twill", is_named="Worsted suiting, navy", weave="twill 2/2 Z", fibre="wool",
        warp=Yarn(count="Nm 2/52", spun="worsted", color="lab(24, 2, -13)", per=34,
                  unit=CENTIMETRE),
        weft=Yarn(count="Nm 2/52", spun="worsted", color="lab(24, 2, -13)", per=28,
                  unit=CENTIMETRE),
        trade=(230, 270),
        source="Suitings are sold by weight [PermanentStyle]; counts, densities and the range of "
        "weight, that of a middling one, are assumed.",
    ),
    Row(
        name="herringbone_tweed", is_named="Herringbone tweed, brown warp and oatmeal weft",
        weave="herringbone 2/2 16", fibre="wool",
        warp=Yarn(count="Nm 4.5", spun="woollen", color="lab(30, 6, 11)", per=10,
                  unit=CENTIMETRE),
        weft=Yarn(count="Nm 4.5", spun="woollen", color="lab(67, 4, 15)", per=9,
                  unit=CENTIMETRE),
        trade=(380, 500),
        source="Rough woollen cloth in a herringbone twill [Tweed]. Counts, densities and the "
        "range of weight are assumed; milling closes the cloth.",
    ),
    Row(
        name="gabardine", is_named="Worsted gabardine, khaki", weave="twill 2/2 Z", fibre="wool",
        warp=Yarn(count="Nm 2/52", spun="worsted", color="lab(58, 3, 19)", per=46,
                  unit=CENTIMETRE),
        weft=Yarn(count="Nm 2/52", spun="worsted", color="lab(58, 3, 19)", per=23,
                  unit=CENTIMETRE),
        trade=(270, 320),
        source="A 2/2 twill with twice as many ends as picks, so that its lines rise at 63 "
        "degrees, of 270 to 320 g/m2 [SimmisGabardine]. Counts are assumed such that it weighs "
        "that.",
    ),
    Row(
        name="viscose_lining", is_named="Viscose lining (taffeta), wine red", weave="plain",
        fibre="viscose",
        warp=Yarn(count="84 dtex", spun="bright", color="lab(36, 39, 15)", per=50,
                  unit=CENTIMETRE),
        weft=Yarn(count="133 dtex", spun="bright", color="lab(36, 39, 15)", per=30,
                  unit=CENTIMETRE),
        trade=(70, 95),
        source="84 and 133 dtex are counts in which viscose filament is sold. Densities and the "
        "range of weight are assumed.",
    ),
    Row(
        name="nylon_ripstop", is_named="Nylon ripstop, orange",
        weave="ripstop 24/3", fibre="nylon",
        cords=Cords(apart=24, wide=3, angle=40.0, color="#bc5a33"),
        warp=Yarn(count="70 den", spun="bright", color="#dc6c3a", per=104, curve=FLAT),
        weft=Yarn(count="70 den", spun="bright", color="#dc6c3a", per=84, curve=FLAT),
        trade=(50, 65),
        source="Parachute cloth of ripstop weave weighs at most 1.1 or 1.6 ounces per square yard "
        "[MILC7020H]; 70 den, densities, the grid and the range of weight are assumed, and so "
        "are cords of three threads, a shade deeper, that stand up from a flat, "
        "calendered ground.",
    ),
    Row(
        name="organza", is_named="Silk organza, blush", weave="plain", fibre="silk",
        warp=Yarn(count="24 den", spun="raw", color="lab(84, 12, 8)", per=44, unit=CENTIMETRE),
        weft=Yarn(count="24 den", spun="raw", color="lab(84, 12, 8)", per=40, unit=CENTIMETRE),
        trade=(17, 26),
        source="Sheer plain weave of hard-twisted filament; organza weighs 4 to 6 momme, of "
        "4.34 g/m2 [SilkMomme]. Counts and densities are assumed such that it weighs that.",
        is_open=True,
    ),
)  # fmt: skip
"""The derived presets, as they are listed in docs/presets.md."""
