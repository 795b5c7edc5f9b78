// Results over time under the picture, with the instant shown as a line that can be dragged.

import uPlot from "uplot";
import { plain } from "./numbers.js";

const PALETTE = {
  light: ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B07D00", "#3A96C8"],
  dark: ["#4DA6E0", "#F0803C", "#2CC79B", "#E39BC4", "#E6B422", "#8CCBEF"],
};
const DASHES = [[], [6, 3], [2, 3]];
const WHOLE = Array.from({ length: 30 }, (_, k) => [1, 2, 5][k % 3] * 10 ** Math.floor(k / 3)); // between numbers of samples
const SHOWN = 6; // series of a result with more: those with the largest peaks

export class Chart {
  /** `onSeek(frame)` is called when the reader points at an instant. */
  constructor(run, first, theme, colours, onSeek) {
    Object.assign(this, { run, theme, colours, onSeek, frame: 0 });
    const array = run.arrays.time;
    this.times = Array.from(array.values);
    this.element = element("section", "chart");
    this.select = element("select");
    this.select.setAttribute("aria-label", "result");
    this.offer();
    this.select.onchange = () => this.choose(Number(this.select.value));
    this.canvas = element("div", "canvas");
    this.legend = element("div", "legend");
    this.element.append(this.select, this.canvas, this.legend);
    new ResizeObserver(() => this.plot?.setSize(this.size)).observe(this.canvas);
    this.choose(first);
  }

  get size() {
    return { width: Math.max(120, this.canvas.clientWidth), height: Math.max(60, this.canvas.clientHeight) };
  }

  offer() {
    const options = this.run.charts.map(({ title, unit }, i) => new Option(unit ? `${title} [${unit}]` : title, i));
    this.select.replaceChildren(...options);
  }

  /** The same result of other numbers. */
  refresh() {
    const index = Number(this.select.value);
    this.offer();
    this.choose(index);
  }

  choose(index) {
    this.select.value = index;
    this.entry = this.run.charts[index];
    const n = this.entry.names.length;
    const rows = this.rows();
    this.moments = rows.map(({ time }) => time);
    this.placeOf = []; // of frames among the rows
    rows.forEach(({ frame }, i) => frame !== undefined && (this.placeOf[frame] = i));
    this.series = this.entry.names.map((name, i) => {
      const numbers = rows.map(({ values, at }) => values[at + i]);
      return { name, numbers, peak: Math.max(...numbers.map((x) => (Number.isFinite(x) ? Math.abs(x) : 0))) };
    });
    const least = n > SHOWN ? [...this.series].sort((a, b) => b.peak - a.peak)[SHOWN - 1].peak : 0;
    let room = SHOWN;
    for (const series of this.series) series.shown = n <= SHOWN || (series.peak >= least && room-- > 0);
    this.draw();
  }

  /** Where the numbers of the result are, in the order of time: those of the frames, and those just before and behind events. */
  rows() {
    const { arrays } = this.run;
    const n = this.entry.names.length;
    const rows = this.times.map((time, frame) => ({ time, frame, values: arrays[this.entry.values].values, at: frame * n }));
    if (this.entry.beside === undefined) return rows;
    const { values } = arrays[this.entry.beside];
    arrays.event_time.values.forEach((time, i) => rows.push({ time, values, at: i * n }));
    return rows.sort((one, other) => one.time - other.time);
  }

  recolour(theme, colours) {
    Object.assign(this, { theme, colours });
    this.draw();
  }

  draw() {
    this.plot?.destroy();
    this.plot = null;
    const shown = this.series.filter((series) => series.shown);
    const palette = PALETTE[this.theme];
    this.series.forEach((series) => (series.colour = null));
    shown.forEach((series, i) => (series.colour = palette[i % palette.length]));
    if (this.times.length > 1) {
      const axis = {
        stroke: this.colours.dim,
        font: "11px system-ui, sans-serif",
        grid: { stroke: this.colours.line, width: 1 },
        ticks: { show: false },
        gap: 4,
      };
      const options = {
        ...this.size,
        legend: { show: false },
        padding: [8, 20, 0, 4], // half of the last number
        cursor: { drag: { x: false, y: false }, points: { show: false }, x: false, y: false },
        scales: { x: { time: false }, y: { range: rangeOf } },
        axes: [
          { ...axis, size: 24, ...(this.run.timed ? {} : { incrs: WHOLE }) },
          {
            ...axis,
            size: 56,
            values: (_, ticks) =>
              ticks.map((tick) => (Math.abs(tick) >= 1e5 ? tick.toExponential(1) : String(Number(tick.toPrecision(6))))),
          },
        ],
        series: [
          {},
          ...shown.map((series, i) => ({
            stroke: series.colour,
            width: 1.6,
            dash: DASHES[Math.floor(i / palette.length) % DASHES.length],
            points: { show: false },
          })),
        ],
        hooks: { draw: [(plot) => this.drawInstant(plot)] },
      };
      const finite = (numbers) => numbers.map((x) => (Number.isFinite(x) ? x : null));
      this.plot = new uPlot(options, [this.moments, ...shown.map((series) => finite(series.numbers))], this.canvas);
      this.listen(this.plot.over);
    }
    this.legend.replaceChildren(...this.series.map((series) => this.chip(series)));
    this.showValues();
  }

  /** Pointing and dragging choose the instant. */
  listen(over) {
    const seek = (event) => {
      const time = this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
      this.onSeek(nearest(this.times, time));
    };
    over.style.touchAction = "pan-y"; // up and down a finger moves the page
    over.onpointerdown = (event) => {
      over.setPointerCapture(event.pointerId);
      seek(event);
    };
    over.onpointermove = (event) => event.buttons && seek(event);
  }

  drawInstant(plot) {
    const x = Math.round(plot.valToPos(this.times[this.frame], "x", true));
    const { top, height } = plot.bbox;
    plot.ctx.save();
    plot.ctx.fillStyle = this.colours.ink;
    plot.ctx.fillRect(x - 1, top, Math.max(1, devicePixelRatio), height);
    plot.ctx.restore();
  }

  chip(series) {
    const button = element("button", "chip");
    button.type = "button";
    button.setAttribute("aria-pressed", series.shown);
    button.style.setProperty("--colour", series.colour ?? "transparent");
    series.value = element("b");
    button.append(element("i"), series.name, series.value);
    button.onclick = () => {
      series.shown = !series.shown;
      this.draw();
    };
    return button;
  }

  update(frame) {
    this.frame = frame;
    this.plot?.redraw(false);
    this.showValues();
  }

  showValues() {
    for (const series of this.series) series.value.textContent = plain(series.numbers[this.placeOf[this.frame]]);
  }
}

/** Of the numbers along a chart: uPlot's, but for nothing but zeros, which it puts below a hundred. */
function rangeOf(_, low, high) {
  return low === 0 && high === 0 ? [-1, 1] : uPlot.rangeNum(low, high, 0.1, true);
}

/** Index of the instant that is nearest. */
export function nearest(times, time) {
  let best = 0;
  times.forEach((other, i) => {
    if (Math.abs(other - time) < Math.abs(times[best] - time)) best = i;
  });
  return best;
}

export function element(tag, className = "", text = "") {
  const node = document.createElement(tag);
  node.className = className;
  node.textContent = text;
  return node;
}
