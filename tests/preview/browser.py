"""Headless Chromium with WebGL2 in software, driven by Playwright; tests skip without either."""

from __future__ import annotations

import base64
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

CHROMIUM = Path("/usr/bin/chromium")

FLAGS = [
    "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-gpu-watchdog",
]  # fmt: skip


IDLE = "window.requestAnimationFrame = () => 0"
"""A script before those of a page, which then draws nothing."""


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser; the test is skipped where there is none."""
    api = pytest.importorskip("playwright.sync_api")
    if not CHROMIUM.exists():
        pytest.skip(f"there is no {CHROMIUM}")
    with api.sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


class Shown:
    """A page in a window, with what went wrong on it.

    said : messages of the console and errors of scripts; asked : addresses that it requested
    """

    def __init__(self, browser: Any, at: Path | str, size: tuple[int, int] = (900, 400)) -> None:
        self.said: list[str] = []
        self.asked: list[str] = []
        self.tab = browser.new_page(viewport={"width": size[0], "height": size[1]})
        self.tab.on("console", lambda m: self.said.append(m.text))
        self.tab.on("pageerror", lambda e: self.said.append(str(e)))
        self.tab.on("request", lambda r: self.asked.append(r.url))
        self.tab.goto(at if isinstance(at, str) else at.as_uri())
        self.until("!!window.fabricusd && fabricusd.viewer.frames >= 1", 180.0)
        self.rest()

    def until(self, code: str, patience: float = 60.0) -> None:
        """Wait until JavaScript is true; Playwright's own way is forbidden by the page's policy."""
        end = time.monotonic() + patience
        while not self.tab.evaluate(code):
            if time.monotonic() > end:
                raise TimeoutError(f"{code}: {self.tab.inner_text('#trouble')} {self.said}")
            time.sleep(0.05)

    def rest(self) -> None:
        """Let the page draw no more: software takes its time from what is tested."""
        self.tab.evaluate("fabricusd.viewer.frames = 1e6")

    def floats(self, code: str, **arrays: np.ndarray) -> np.ndarray:
        """A Float32Array that JavaScript computes of others."""
        given = {
            name: {
                "type": "f4",
                "data": base64.b64encode(values.astype("<f4").tobytes()).decode(),
            }
            for name, values in arrays.items()
        }
        text = self.tab.evaluate(
            "given => { const { viewer, decode } = fabricusd; const a = {};"
            "for (const n in given) a[n] = decode(given[n]);"
            f"const out = {code}; const bytes = new Uint8Array(out.buffer); let s = '';"
            "for (let k = 0; k < bytes.length; k += 32768)"
            "s += String.fromCharCode(...bytes.subarray(k, k + 32768)); return btoa(s); }",
            given,
        )
        return np.frombuffer(base64.b64decode(text), "<f4")
