"""The options of a review: light, background, studio, camera, law, without a line of USD."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from fabricusd.cli.arguments.number import number
from fabricusd.errors import FabricError
from fabricusd.weaves.color import parse_color

if TYPE_CHECKING:
    from fabricusd.scene.staging import Staging


def add_staging(parser: argparse.ArgumentParser) -> None:
    """Light, background, camera and surface law."""
    group = parser.add_argument_group("light, background, camera and surface law of a review")
    group.add_argument(
        "--dome",
        metavar="SKY",
        help="latitude-longitude picture that lights the scene instead of its domes "
        "(default: the scene's domes)",
    )
    group.add_argument(
        "--dome-rotation",
        type=number("dome_rotation"),
        default=0.0,
        metavar="DEGREES",
        help="turn the domes about the up axis, counter-clockwise from above (default: 0)",
    )
    group.add_argument(
        "--background",
        metavar="COLOR",
        help="colour behind the scene, #rrggbb or linear r,g,b; domes still light it "
        "(default: the domes)",
    )
    group.add_argument(
        "--studio",
        action="store_true",
        help="light the scene by a studio instead of its lights, before a grey backdrop",
    )
    group.add_argument(
        "--frame",
        default="",
        metavar="PRIM",
        help="let the camera frame this prim, by path or unique name; / is the whole scene "
        "(default: the camera as it stands)",
    )
    for name, what in (("eye", "the camera stands"), ("look-at", "the camera looks")):
        group.add_argument(
            f"--{name}",
            metavar="X,Y,Z",
            help=f"where {what}, in metres in the scene's axes (default: as it does)",
        )
    group.add_argument(
        "--orbit",
        type=number("orbit"),
        default=0,
        metavar="N",
        help="render N numbered pictures from around the subject (default: one, from the camera)",
    )

    group.add_argument(
        "--surface-law",
        choices=["masked", "unmasked", "projected", "visible", "facets"],
        help="how light on threads becomes light on cloth, in all fabrics; their albedos are kept "
        "(default: each fabric's own law)",
    )


def given_staging(options: argparse.Namespace) -> Staging:
    """What the options ask for; FabricError for a colour or a place that is none."""
    from fabricusd.scene.staging import Staging

    background = options.background
    return Staging(
        dome=options.dome,
        dome_rotation=math.radians(options.dome_rotation),
        background=None if background is None else parse_color(background, "--background"),
        studio=options.studio,
        frame=options.frame,
        eye=_place(options.eye, "--eye"),
        look_at=_place(options.look_at, "--look-at"),
        orbit=options.orbit,
        surface_law=options.surface_law or "",
    )


def _place(text: str | None, where: str) -> tuple[float, float, float] | None:
    """`0,1.2,3` -> three numbers."""
    if text is None:
        return None
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(math.isfinite(k) and abs(k) < 1e6 for k in (x, y, z)):
        raise FabricError(
            where, f"is '{text[:40]}'; it must be three numbers of metres, as in 0,1.2,3"
        )
    return x, y, z
