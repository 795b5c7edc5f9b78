// The door: a page with a run in it shows that; a notebook's widget asks for `render`.

import { unpack } from "./data.js";
import { Viewer } from "./viewer.js";
import { render } from "./widget.js";

const held = document.getElementById("linkdyn-run");
if (held) open(held.textContent);

/** `#t=0.35` is the instant, `&theme=dark` the colours, `&still` does not play. */
async function open(text) {
  const wishes = new URLSearchParams(location.hash.slice(1));
  const host = document.getElementById("linkdyn-view");
  try {
    const viewer = new Viewer(host, await unpack(text), { theme: wishes.get("theme") ?? undefined });
    if (wishes.has("t")) viewer.player.seekTime(Number(wishes.get("t")));
    else if (!wishes.has("still") && !matchMedia("(prefers-reduced-motion: reduce)").matches) viewer.player.toggle(true);
    if (window === window.top) viewer.page.focus({ preventScroll: true }); // keys work at once
    host.viewer = viewer;
  } catch (error) {
    host.textContent = `This run cannot be shown: ${error.message}`;
    throw error;
  }
}

export default { render };
