// The whole view in one element: picture, legend, player, charts.

import * as THREE from "three";
import { STLLoader } from "three/addons/loaders/STLLoader.js";
import { Arrows } from "./arrows.js";
import { Chart, element } from "./charts.js";
import { frameOf } from "./data.js";
import { Mechanism } from "./mechanism.js";
import { niceBelow, withPrefix } from "./numbers.js";
import { drawPlanar } from "./planar.js";
import { Player } from "./player.js";
import { vector } from "./shapes.js";
import { drawSpatial } from "./spatial.js";
import { Springs } from "./springs.js";
import { pointsOf, Stage } from "./stage.js";
import style from "./style.css";
import { preferredTheme, THEMES } from "./theme.js";
import { drawTraces } from "./traces.js";

const KINDS = { driving: "drives", reaction: "joint forces", load: "loads" };
const BAR = [45, 130]; // shortest and longest bar of the legend, pixels
const CORNERS = ["bottom left", "bottom right", "top left", "top right"]; // for the legend, the first that hides least
const STEPS = { ArrowLeft: -1, ArrowRight: 1, PageUp: -25, PageDown: 25, Home: -Infinity, End: Infinity };

export class Viewer {
  /** In a host element, whose look it does not touch and which does not touch its own. */
  constructor(host, run, { theme = preferredTheme() } = {}) {
    this.host = host;
    this.root = host.shadowRoot ?? host.attachShadow({ mode: "open" });
    this.shown = new Set(run.shown);
    this.magnify = 1;
    this.theme = theme;
    this.build(run);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.setTheme(preferredTheme()));
    this.root.addEventListener("keydown", (event) => this.onKey(event));
  }

  build(run) {
    this.run = run;
    this.mechanism = new Mechanism(run);
    this.frame = 0;
    this.page = element("div", "page");
    this.page.tabIndex = 0;
    this.picture = element("div", "picture");
    this.labels = element("div", "labels");
    this.names = run.names.map(([text, isLink, ...places]) => ({ label: element("span", isLink ? "link" : "joint", text), isLink, places, side: 0 }));
    this.labels.append(...this.names.map(({ label }) => label));
    this.notice = element("div", "notice");
    this.legend = element("div", "scales");
    this.picture.append(this.labels, this.legend, this.notice);
    const charts = element("div", "charts");
    this.page.append(this.header(), this.picture);
    const times = Array.from(run.arrays.time.values);
    this.player = new Player(times, run.timed, (frame) => this.show(frame));
    if (times.length > 1) this.page.append(this.player.element);
    else this.page.classList.add("single"); // the numbers of its results, and no curves
    if (run.charts.length) this.page.append(charts);
    const sheet = element("style", "", style);
    this.root.replaceChildren(sheet, this.page);
    this.stage = new Stage(this.picture, run);
    this.stage.drawn.push(() => this.drawn());
    this.charts = run.plots.map(
      (first) => new Chart(run, first, this.theme, THEMES[this.theme], (frame) => this.player.seek(frame)),
    );
    charts.append(...this.charts.map((chart) => chart.element));
    this.setTheme(this.theme);
    this.player.seek(0);
  }

  header() {
    const bar = element("header");
    const title = element("h1", "", this.run.title || "linkdyn");
    title.title = title.textContent; // long ones are cut
    const buttons = element("div", "switches");
    const kinds = Object.keys(KINDS).filter((kind) => this.run.arrows.some((entry) => entry.kind === kind));
    for (const kind of kinds) buttons.append(this.toggle(kind, KINDS[kind]));
    if (this.run.traces.length) buttons.append(this.toggle("traces", "traces"));
    buttons.append(this.toggle("names", "names"));
    if (kinds.length) buttons.append(this.magnifier());
    const fit = this.button("fit", "Show all of it again", () => this.stage.fit());
    const dark = this.button("◐", "Dark or light", () => this.setTheme(this.theme === "dark" ? "light" : "dark"));
    dark.classList.add("theme");
    buttons.append(fit, dark);
    bar.append(title, buttons);
    return bar;
  }

  button(text, says, onclick) {
    const button = Object.assign(element("button", "", text), { type: "button", title: says, onclick });
    button.setAttribute("aria-label", says);
    return button;
  }

  toggle(key, text) {
    const button = Object.assign(element("button", `switch ${key}`, text), { type: "button" });
    const show = () => button.setAttribute("aria-pressed", this.shown.has(key));
    show();
    button.onclick = () => {
      if (!this.shown.delete(key)) this.shown.add(key);
      show();
      this.applyShown();
    };
    return button;
  }

  magnifier() {
    const label = element("label", "magnify", "arrows");
    label.title = "Length of the arrows";
    const input = Object.assign(element("input"), { type: "range", min: -2, max: 2, step: 0.25, value: Math.log2(this.magnify) });
    input.oninput = () => {
      this.magnify = this.arrows.magnify = 2 ** Number(input.value);
      this.show(this.frame);
    };
    label.append(input);
    return label;
  }

  /** Build what has colours anew. */
  setTheme(theme) {
    this.theme = theme;
    const colours = THEMES[theme];
    this.page.dataset.theme = theme;
    const { scene } = this.stage;
    this.stage.furnish(colours);
    const palette = this.palette(colours);
    this.links = this.run.planar
      ? drawPlanar(this.mechanism, palette)
      : drawSpatial(this.mechanism, palette, { up: this.stage.up, ground: this.run.ground });
    this.putMeshes(palette);
    this.springs = new Springs(this.mechanism, this.links, palette, this.run.planar, (place) => this.placeOf(place));
    this.arrows = new Arrows(this.run, colours, (place) => this.placeOf(place));
    this.arrows.magnify = this.magnify;
    this.traces = drawTraces(
      this.run,
      (link) => palette.link(link).trace,
      (point, link, frame) => point.applyMatrix4(this.poseOf(link, frame)),
    );
    scene.add(...this.links, this.springs.object, this.traces, this.arrows.object);
    for (const chart of this.charts) chart.recolour(theme, colours);
    this.applyShown();
  }

  palette(colours) {
    const { planar, palette } = this.run;
    const isDark = this.theme === "dark";
    const make = (colour) =>
      planar
        ? new THREE.MeshBasicMaterial({ color: colour })
        : new THREE.MeshStandardMaterial({ color: colour, roughness: 0.55, metalness: 0.12 });
    const mix = (colour, other, part) => new THREE.Color(colour).lerp(new THREE.Color(other), part);
    const link = (k) => {
      const own = new THREE.Color(k === 0 ? colours.frame : palette[(k - 1) % palette.length]);
      return {
        solid: make(isDark ? mix(own, "#ffffff", 0.15) : own),
        fill: make(isDark ? mix(own, colours.background, 0.15) : mix(own, "#ffffff", 0.3)),
        pale: make(mix(own, colours.background, isDark ? 0.62 : 0.68)),
        edge: make(mix(own, isDark ? "#ffffff" : "#000000", isDark ? 0.35 : 0.45)),
        trace: isDark ? mix(own, "#ffffff", 0.3) : own,
      };
    };
    const links = this.run.links.map((_, k) => link(k));
    return {
      link: (k) => links[k],
      frame: make(colours.frame),
      edge: make(colours.edge),
      pivot: make(colours.pivot),
      barrel: make(colours.barrel),
      groundLine: make(colours.frame),
      rod: make(colours.rod),
      joint: make(isDark ? "#aab3bd" : "#3a424b"),
      spring: make(colours.spring),
      hatching: new THREE.LineBasicMaterial({ color: colours.frame }),
    };
  }

  /** Bodies as they were designed, in place of what stands for them. */
  putMeshes(palette) {
    for (const { link, values, scale, offset } of this.run.meshes) {
      const { values: bytes } = this.run.arrays[values];
      const geometry = new STLLoader().parse(bytes.slice().buffer).scale(scale, scale, scale);
      geometry.computeVertexNormals(); // of the triangles: many programs write zeros for them, and nothing of that has a colour
      const mesh = new THREE.Mesh(
        geometry,
        new THREE.MeshStandardMaterial({ color: palette.link(link).solid.color, roughness: 0.6, metalness: 0.15 }),
      );
      mesh.castShadow = mesh.receiveShadow = true;
      if (offset) mesh.position.fromArray(offset);
      this.links[link].clear();
      this.links[link].add(mesh);
    }
  }

  poseOf(link, frame) {
    const pose = new THREE.Matrix4();
    if (link === 0) return pose;
    const { position, axes } = this.run.arrays;
    const p = frameOf(position, frame).subarray(3 * (link - 1)),
      a = frameOf(axes, frame).subarray(6 * (link - 1));
    const x = vector([a[0], a[1], a[2]]).normalize(),
      y = vector([a[3], a[4], a[5]]).normalize();
    return pose.makeBasis(x, y, new THREE.Vector3().crossVectors(x, y)).setPosition(p[0], p[1], p[2]);
  }

  /** A place [link, x, y, z] in world axes. */
  placeOf([link, ...at]) {
    return vector(at).applyMatrix4(this.poseOf(link, this.frame));
  }

  show(frame) {
    this.frame = frame;
    const status = this.run.arrays.status.values[frame];
    this.notice.textContent = status === 0 ? "" : `not computed here: ${this.run.flags[status] ?? status}`;
    this.links.forEach((link, k) => {
      link.matrixAutoUpdate = false;
      link.matrix.copy(this.poseOf(k, frame));
      link.matrixWorldNeedsUpdate = true;
    });
    this.springs.update();
    this.arrows.update(frame);
    for (const chart of this.charts) chart.update(frame);
    this.stage.request();
  }

  applyShown() {
    for (const kind of Object.keys(KINDS)) this.arrows.show(kind, this.shown.has(kind));
    this.traces.visible = this.shown.has("traces");
    this.labels.hidden = !this.shown.has("names");
    this.show(this.frame);
  }

  /** After each picture: names and scales in front of it, and what tests ask for. */
  drawn() {
    this.placeNames();
    this.drawScales();
    Object.assign(this.host.dataset, { frame: this.frame, arrows: this.arrows.count, theme: this.theme });
  }

  /** Each name on the side of its place where no other is, the one of the last picture if it can, and whole where its place is seen. */
  placeNames() {
    if (this.labels.hidden) return;
    const taken = [];
    const { width } = this.stage;
    for (const name of this.names) {
      const middle = name.places
        .map((place) => this.placeOf(place))
        .reduce((sum, point) => sum.add(point))
        .divideScalar(name.places.length);
      const at = this.stage.project(middle);
      name.label.hidden = !at;
      if (!at) continue;
      name.size ??= [name.label.offsetWidth, name.label.offsetHeight];
      const isSeen = at[0] >= 0 && at[0] <= width;
      const boxes = sidesOf(at, name.size, name.isLink).map((box) => (isSeen ? moveWithin(box, width) : box));
      const isFree = ([x, y, right, low]) => taken.every(([a, b, c, d]) => x >= c || right <= a || y >= d || low <= b);
      if (!isFree(boxes[name.side])) name.side = Math.max(0, boxes.findIndex(isFree));
      const box = boxes[name.side];
      name.label.hidden = !isFree(box); // two names in one place are none
      if (name.label.hidden) continue;
      taken.push(box);
      name.label.style.transform = `translate(${box[0].toFixed(1)}px, ${box[1].toFixed(1)}px)`;
    }
  }

  /** Bars as long as an arrow of a round force is where the mechanism is. */
  drawScales() {
    const rows = [];
    for (const [torque, unit] of [
      [false, "N"],
      [true, "N·m"],
    ]) {
      const entries = this.run.arrows.filter(
        (entry) => entry.torque === torque && entry.largest > 0 && this.shown.has(entry.kind),
      );
      if (!entries.length) continue;
      const labels = new Map(entries.map((entry) => [entry.label, entry.kind]));
      const row = element("div", "scale");
      row.append(...[...labels].map(([label, kind]) => element("span", `kind ${kind}`, label)));
      if (torque && this.run.planar)
        row.append(element("span", "size", `¾ turn: ${withPrefix(this.arrows.largest(true), unit)}`));
      else {
        const perUnit = this.arrows.scale(torque) * this.stage.pixelsPerMetre;
        const value = niceBelow(BAR[1] / perUnit);
        const bar = element("i");
        bar.style.width = `${Math.max(1, value * perUnit).toFixed(1)}px`;
        const size = element("span", "size");
        size.append(bar, withPrefix(value, unit));
        row.append(size);
      }
      rows.push(row);
    }
    rows.push(
      element("div", "grid", `grid ${withPrefix(this.stage.cell, "m")}${this.run.stride ? ` · ${this.run.stride}` : ""}`),
    );
    this.legend.replaceChildren(...rows);
    if (this.cornered !== `${this.stage.fits} ${this.stage.width} ${this.stage.height}`) this.chooseCorner();
  }

  /** The legend where it hides least of the mechanism. */
  chooseCorner() {
    const { stage } = this;
    const points = pointsOf(this.run.arrays.cloud).map((point) => stage.project(point)).filter(Boolean);
    const [width, height] = [this.legend.offsetWidth + 30, this.legend.offsetHeight + 30];
    const hidden = CORNERS.map((corner) => {
      const isThere = ([x, y]) =>
        (corner.includes("left") ? x < width : x > stage.width - width) && (corner.includes("top") ? y < height : y > stage.height - height);
      return points.filter(isThere).length;
    });
    this.legend.dataset.corner = CORNERS[hidden.indexOf(Math.min(...hidden))];
    this.cornered = `${stage.fits} ${stage.width} ${stage.height}`;
  }

  onKey(event) {
    if (event.target.matches?.("input, select, button")) return;
    if (event.key === " ") this.player.toggle();
    else if (event.key in STEPS) {
      this.player.toggle(false);
      this.player.seek(this.frame + STEPS[event.key]);
    } else return;
    event.preventDefault();
  }

  /** Other numbers for the same mechanism, to the same scale. */
  replace({ arrays, charts }) {
    Object.assign(this.run, { arrays, charts });
    for (const chart of this.charts) chart.refresh();
    for (const item of this.arrows.layers) item.array = arrays[item.entry.values];
    this.show(0);
  }
}

/** Boxes [left, top, right, bottom] of a name about a place: beside it, joints above, links below at first. */
function sidesOf([x, y], [width, height], isLink) {
  const [above, below] = [y - height - 6, y + 4];
  const first = isLink ? [below, above] : [above, below];
  const corners = [
    [x + 9, first[0]],
    [x + 9, first[1]],
    [x - width - 9, first[0]],
    [x - width - 9, first[1]],
    [x - width / 2, above - height],
    [x - width / 2, below + height],
  ];
  return corners.map(([left, top]) => [left, top, left + width, top + height]);
}

/** A box [left, top, right, bottom] moved sideways as little as need be to lie between 0 and `end`. */
function moveWithin([left, top, right, bottom], end) {
  const start = Math.max(0, Math.min(left, end - (right - left)));
  return [start, top, start + right - left, bottom];
}
