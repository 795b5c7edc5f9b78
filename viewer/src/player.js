// Play, pause, step, scrub: which frame is shown.

import { element, nearest } from "./charts.js";

const RATES = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100];
const ICONS = { play: "M4 2.5v11l9.5-5.5z", pause: "M4 2.5h3v11H4zm5 0h3v11H9z" };
const SECONDS = [4, 14]; // that a run should take to watch

export class Player {
  /** `onFrame(frame)` shows one. */
  constructor(times, hasTime, onFrame) {
    Object.assign(this, { times, hasTime, onFrame, frame: 0, playing: false });
    this.element = element("div", "player");
    this.button = element("button", "play");
    this.button.type = "button";
    this.button.onclick = () => this.toggle();
    this.slider = Object.assign(element("input"), { type: "range", min: 0, max: times.length - 1, step: 1, value: 0 });
    this.slider.setAttribute("aria-label", hasTime ? "time" : "sample");
    this.slider.oninput = () => this.seek(Number(this.slider.value));
    this.clock = element("output");
    this.rate = element("select");
    this.rate.setAttribute("aria-label", "speed");
    for (const rate of RATES) this.rate.add(new Option(`× ${rate}`, rate));
    this.rate.value = this.fittingRate();
    this.rate.onchange = () => this.anchor();
    this.element.append(this.button, this.slider, this.clock, this.rate);
    this.drawButton();
  }

  get duration() {
    return this.times.at(-1) - this.times[0];
  }

  fittingRate() {
    const [least, most] = SECONDS;
    const seconds = Math.min(most, Math.max(least, this.duration));
    const wanted = Math.log(this.duration / seconds || 1);
    return RATES.reduce((a, b) => (Math.abs(Math.log(b) - wanted) < Math.abs(Math.log(a) - wanted) ? b : a));
  }

  seek(frame) {
    this.frame = Math.max(0, Math.min(this.times.length - 1, frame));
    this.slider.value = this.frame;
    this.slider.style.setProperty("--part", `${(100 * this.frame) / Math.max(1, this.times.length - 1)}%`);
    const time = this.times[this.frame];
    this.clock.textContent = this.hasTime ? `${time.toFixed(this.duration < 10 ? 3 : 2)} s` : `sample ${time}`;
    this.anchor();
    this.onFrame(this.frame);
  }

  seekTime(time) {
    this.seek(nearest(this.times, time));
  }

  /** From here and now on the clock counts. */
  anchor() {
    this.from = { time: this.times[this.frame], clock: performance.now() };
  }

  toggle(playing = !this.playing) {
    this.playing = playing && this.times.length > 1;
    if (this.playing && this.frame === this.times.length - 1) this.seek(0);
    this.anchor();
    this.drawButton();
    if (this.playing) requestAnimationFrame(() => this.tick());
  }

  tick() {
    if (!this.playing) return;
    const { time, clock } = this.from;
    const passed = ((performance.now() - clock) / 1000) * Number(this.rate.value);
    const now = this.times[0] + ((time - this.times[0] + passed) % (this.duration || 1));
    const frame = nearest(this.times, now);
    if (frame !== this.frame) {
      const { from } = this;
      this.seek(frame);
      this.from = from; // the clock goes on
    }
    requestAnimationFrame(() => this.tick());
  }

  drawButton() {
    this.button.innerHTML = `<svg viewBox="0 0 16 16"><path d="${ICONS[this.playing ? "pause" : "play"]}"/></svg>`;
    this.button.setAttribute("aria-label", this.playing ? "pause" : "play");
  }
}
