// The live view of a notebook (anywidget): sliders move the coordinates, the kernel answers with poses and forces.

import { element } from "./charts.js";
import { withArrays } from "./data.js";
import { plain } from "./numbers.js";
import { Viewer } from "./viewer.js";

export function render({ model, el }) {
  const host = element("div");
  host.style.height = `${model.get("height")}px`;
  el.append(host);
  const read = () => {
    const { buffer, byteOffset, byteLength } = model.get("block");
    return withArrays(model.get("description"), buffer.slice(byteOffset, byteOffset + byteLength));
  };
  const viewer = new Viewer(host, read());
  host.viewer = viewer;
  viewer.page.append(sliders(model));
  model.on("change:block", () => viewer.replace(read()));
}

function sliders(model) {
  const panel = element("div", "sliders");
  model.get("coordinates").forEach(({ name, unit, factor, low, high }, i) => {
    const value = element("output");
    const input = Object.assign(element("input"), {
      type: "range",
      min: low,
      max: high,
      step: (high - low) / 1000,
      value: model.get("q")[i],
    });
    input.setAttribute("aria-label", name);
    const tell = (number) => (value.textContent = `${plain(number * factor)} ${unit}`);
    input.oninput = () => {
      const q = [...model.get("q")];
      q[i] = Number(input.value);
      model.set("q", q);
      model.save_changes();
      tell(q[i]);
    };
    tell(model.get("q")[i]); // a slider goes by steps
    panel.append(element("span", "", name), input, value);
  });
  return panel;
}
