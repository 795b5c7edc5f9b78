"""The live view: what the sliders ask, Python computes, and the page shows."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import pytest

import linkdyn
from linkdyn._view import page as view_page

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
PAGE = """<!DOCTYPE html><meta charset="utf-8"><div id="place" style="height: 700px"></div><script type="module">
import widget from "data:text/javascript;base64,{code}";
const held = {state}, listeners = {{}};
const bytes = (text) => new DataView(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
held.block = bytes(held.block);
window.asked = [];
window.model = {{ get: (key) => held[key], set: (key, value) => (held[key] = value), save_changes: () => window.asked.push(held.q),
  on: (what, call) => (listeners[what] = call) }};
window.answer = ({{ description, block }}) => {{ Object.assign(held, {{ description, block: bytes(block) }}); listeners["change:block"](); }};
const place = document.getElementById("place");
widget.render({{ model: window.model, el: place }});
place.firstChild.id = "linkdyn-view";
</script>"""


@pytest.fixture()
def live():
    return linkdyn.widget.Live(linkdyn.load(EXAMPLES / "fourbar" / "scene.toml"))


def packed(live) -> dict[str, object]:
    return {"description": live.description, "block": base64.b64encode(live.block).decode()}


def test_sliders(browser, live, tmp_path):
    state = packed(live) | {"coordinates": live.coordinates, "q": live.q, "height": 600}
    code = base64.b64encode(view_page.bundle().encode()).decode()
    (tmp_path / "live.html").write_text(PAGE.format(code=code, state=json.dumps(state)))
    page = browser.open(tmp_path / "live.html")
    tell = "root.querySelector('.chip b').textContent"
    assert float(page.value(tell)) == pytest.approx(live.run.driving_force.item() / 1e3, rel=1e-3)
    page.value("(s => { s.value = 2; s.dispatchEvent(new Event('input')); })(root.querySelector('.sliders input'))")
    (asked,) = page.value("asked")
    assert asked == pytest.approx([2.0], abs=0.01)
    live.q = asked
    page.value(f"answer({json.dumps(packed(live))})")
    assert float(page.value(tell)) == pytest.approx(live.run.driving_force.item() / 1e3, rel=1e-3)
    crank = page.value("document.querySelector('#linkdyn-view').viewer.placeOf([1, 4, 0, 0]).toArray().slice(0, 2)")
    np.testing.assert_allclose(crank, [10 + 4 * np.cos(asked[0]), 4 * np.sin(asked[0])], atol=1e-3)
    assert not page.complaints


def test_numbers_are_those_of_inverse(live):
    scene = linkdyn.load(EXAMPLES / "fourbar" / "scene.toml")
    live.q = [1.25]
    assert live.run.driving_force.item() == scene.inverse([[1.25]], t=0.0).driving_force.item()


def test_out_of_reach_the_picture_stays():
    live = linkdyn.widget.Live(linkdyn.load(EXAMPLES / "stewart_tsai" / "scene.toml"))
    before, q = live.block, live.q
    live.q = [*q[:2], 1e7, *q[3:]]
    assert live.run.status.values[0] in (0, 1)
    if live.run.status.values[0] == 1:
        assert live.block == before
    live.q = [q[0] + 0.1, *q[1:]]
    assert live.run.status.values[0] == 0 and live.block != before


def test_refused(live):
    with pytest.raises(linkdyn.InputError, match="expected a Scene"):
        linkdyn.widget.Live("scene.toml")
    with pytest.raises(linkdyn.InputError, match="expected 1 numbers"):
        live.q = [1.0, 2.0]
