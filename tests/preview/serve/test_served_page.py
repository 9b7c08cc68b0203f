"""The served page in headless Chromium: what its server makes, opens, traces and saves for it."""

from __future__ import annotations

import http.server
import threading

import pytest

from fabricusd.fabric import Fabric
from fabricusd.preview.lights import Lights
from fabricusd.preview.serve.server import TOKEN
from fabricusd.preview.serve.session import Session
from fabricusd.schema.check import check
from fabricusd.schema.read import load
from fabricusd.weaves import from_fabric, wif_text
from tests.preview.browser import Shown, chromium
from tests.preview.serve.requests import serving


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    file = tmp_path_factory.mktemp("served") / "look.usda"
    with chromium() as browser, serving(Session(Fabric(), lights=Lights(), save=file)) as server:
        one = Shown(browser, server.url, (620, 240))
        one.server, one.browser = server, browser
        yield one


def remade(shown: Shown) -> None:
    """Wait until the page shows what its state says, by the server's tables."""
    shown.until("!document.getElementById('busy').textContent")
    shown.until("fabricusd.cloth.whole === fabricusd.whole()")
    shown.rest()


def test_the_token_does_not_stay_in_the_address(shown):
    assert shown.said == []
    assert shown.server.token not in shown.tab.url
    assert shown.server.token not in " ".join(url.partition("#")[0] for url in shown.asked)
    assert {url.partition("#")[0].rpartition("/")[2] for url in shown.asked} == {
        "", "page.css", "page.js", "fabric"
    }  # fmt: skip


def test_a_weave_is_drawn_by_hand_and_by_keys_and_undone(shown):
    tab = shown.tab
    tab.focus("#grid")
    for key in ("ArrowRight", "ArrowUp", " "):
        tab.keyboard.press(key)
    assert tab.evaluate("fabricusd.state.weave") == "10/00"
    assert tab.inner_text("#cell") == "End 2 of 2, pick 2 of 2: weft on top."
    remade(shown)
    assert tab.evaluate("fabricusd.cloth.weave") == "10/00"
    tab.locator("#grid").click(position={"x": 5, "y": 5})
    assert tab.evaluate("fabricusd.state.weave") == "10/10"
    tab.click("#undo")
    tab.click("#undo")
    assert tab.evaluate("fabricusd.state.weave") == ""
    remade(shown)


def test_numbers_beyond_the_page_s_tables_and_coverage_are_made_by_the_server(shown):
    tab = shown.tab
    field = tab.get_by_label("Warp covers").last
    field.fill("0.25")
    field.press("Enter")
    remade(shown)
    assert abs(tab.evaluate("fabricusd.cloth.coverage[0]") - 0.25) < 1e-6
    tab.click("#reset")
    remade(shown)
    assert tab.evaluate("fabricusd.state.coverage") == [-1, -1]


def test_a_draft_is_dropped_opened_and_undone(shown):
    tab = shown.tab
    draft = wif_text(from_fabric(Fabric(name="Fabric"))).encode()
    tab.evaluate(
        "text => { const held = new DataTransfer(); held.items.add(new File([text], 'mine.wif'));"
        "document.body.dispatchEvent(new DragEvent('drop', { dataTransfer: held, bubbles: true,"
        "cancelable: true })); }",
        draft.decode(),
    )
    shown.until("fabricusd.data.name === 'mine'")
    shown.rest()
    assert "mine.wif is open" in tab.inner_text("#told")
    tab.click("#undo")
    assert tab.evaluate("fabricusd.data.name") == "Fabric"
    tab.set_input_files("#open", {"name": "bad.wif", "mimeType": "", "buffer": b"nothing"})
    shown.until("!document.getElementById('trouble').hidden")
    assert "bad.wif" in tab.inner_text("#trouble")
    shown.rest()


def test_a_variant_is_saved(shown):
    tab = shown.tab
    field = tab.locator("#thread0 input[type=number]").first
    field.fill("0.5")
    field.press("Enter")
    tab.fill("#variant", "red")
    tab.click("#saveVariant")
    shown.until("document.getElementById('told').textContent.includes('variant red')")
    file = shown.server.session.file
    assert check(file) == []
    assert load(f"{file}{{fabricVariant=red}}").threads["Thread"].albedo == (0.5, 0.2, 0.2)
    tab.click("#reset")
    remade(shown)


@pytest.mark.slow
def test_the_path_tracer_s_picture_is_wiped_and_differs_little(shown):
    tab = shown.tab
    tab.fill("#samples", "64")
    tab.click("#trace")
    # The page draws on until its picture is fine and has 64 directions of the sky.
    shown.until("fabricusd.traced?.found?.frames >= 64", 300.0)
    assert tab.locator("#wipe").is_visible()
    found = tab.evaluate("fabricusd.traced.found")
    assert 0.0 < found["whole"] < 1.0
    assert found["covered"] < 1.5
    tab.select_option("#compare", "heat")
    shown.until("!document.getElementById('legend').hidden")
    assert "ΔE2000" in tab.inner_text("#compared")
    tab.focus("#view")
    tab.keyboard.press("ArrowLeft")
    shown.until("document.getElementById('compared').textContent.includes('has changed')")
    shown.rest()


def test_a_page_of_another_origin_gets_nothing(shown, tmp_path):
    (tmp_path / "evil.html").write_text("<!doctype html><title>evil</title>")

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            """Say nothing."""

        def __init__(self, *given):
            super().__init__(*given, directory=str(tmp_path))

    other = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet)
    thread = threading.Thread(target=other.serve_forever)
    thread.start()
    answers: list[str] = []
    real = shown.server.session.answer
    shown.server.session.answer = lambda path, body: answers.append(path) or real(path, body)
    try:
        tab = shown.browser.new_page()
        tab.goto(f"http://127.0.0.1:{other.server_port}/evil.html")
        url = f"http://127.0.0.1:{shown.server.server_port}"
        tries = tab.evaluate(
            "async ({ url, name, token }) => { const got = []; const headers = {"
            "  'Content-Type': 'application/json', [name]: token };"
            "for (const [path, more] of [['/fabric', { method: 'POST', headers, body: '{}' }],"
            "  ['/fabric', { method: 'POST', body: '{}' }], ['/', {}], ['/page.js', {}],"
            "  ['/fabric', { method: 'POST', mode: 'no-cors', body: '{}' }]]) {"
            "  try { const a = await fetch(url + path, more); got.push(await a.text()); }"
            "  catch { got.push('refused'); } } return got; }",
            {"url": url, "name": TOKEN, "token": shown.server.token},
        )
        assert set(tries) <= {"refused", ""}
        tab.close()
    finally:
        del shown.server.session.answer
        other.shutdown()
        other.server_close()
        thread.join()
    assert answers == []
