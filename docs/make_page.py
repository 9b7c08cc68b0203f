"""Take docs/images/preview_page.png: the served page of denim, with a wipe against the path tracer.

python docs/make_page.py [-o FILE] [--frames N]

It needs Chromium and Playwright, as the tests of the page do; without them the picture stays as it
is. The page draws in software, at seconds a frame.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from fabricusd.preview.lights import Lights  # noqa: E402
from fabricusd.preview.serve.session import Session  # noqa: E402
from fabricusd.schema import load  # noqa: E402
from tests.preview.browser import CHROMIUM, Shown, chromium  # noqa: E402
from tests.preview.serve.requests import serving  # noqa: E402

WINDOW = (1100, 860)
"""Width and height [pixels]."""

OPENED = ("thread0 Curve, along a run", "thread0 Yarn, as the path tracer shows it")
"""Folds of the panel that are open in the picture."""

PATIENCE = 900.0
"""How long the path tracer or the page may take [s]."""


def shoot(target: Path, frames: int) -> None:
    """Trace the first view, wait for `frames` of the page, and take a picture."""
    session = Session(load("denim"), lights=Lights())
    with chromium() as browser, serving(session) as server:
        shown = Shown(browser, server.url, WINDOW)
        shown.tab.click("#trace")
        shown.until("!document.getElementById('wipe').hidden", PATIENCE)
        # The page is coarse at first, and says how far it is from the path tracer once it is not.
        shown.until(
            "document.getElementById('compared').textContent.includes('ΔE')"
            f" && fabricusd.viewer.frames >= {frames}",
            PATIENCE,
        )
        shown.rest()
        shown.tab.evaluate(
            "names => { for (const name of names) document.getElementById(name).open = true;"
            "document.getElementById('trace').scrollIntoView(); }",
            list(OPENED),
        )
        shown.tab.screenshot(path=str(target))


def main() -> int:
    """Take the picture where there is a browser."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=32)
    parser.add_argument("-o", "--output", type=Path, default=HERE / "images" / "preview_page.png")
    options = parser.parse_args()
    if not CHROMIUM.exists():
        print(f"there is no {CHROMIUM}; the picture of the page stays as it is")
        return 0
    begun = time.perf_counter()
    shoot(options.output, options.frames)
    print(f"{options.output}: {time.perf_counter() - begun:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
