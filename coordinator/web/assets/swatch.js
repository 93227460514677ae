// A swatch that is drawn anew as one turns its light and its camera.

import { el, fill, setText } from "./dom.js";
import { sentence } from "./format.js";
import { problemOf } from "./live.js";
import { TurningPad } from "./turning_pad.js";

// While something moves, pictures are as large as can be drawn in this time; then come finer ones.
const DRAFT_S = 0.4;
const FINE_S = 4;
const SIZES = [64, 96, 128, 160, 192, 240, 288, 352, 416, 448];
const SAMPLES = 8;
const SLOWEST = 1000;  // pixels a second
const SETTLED_MS = 200;
const RETRY_MS = 1000;
const AWAY_MS = 3000;
const SCALES_MM = [0.1, 0.2, 0.5, 1, 2, 5, 10];

// As SwatchView in coordinator/web/swatch_view.h.
const START = { light_azimuth: 147, light_elevation: 49, camera_azimuth: -90, camera_elevation: 62, sharpness: 60, height: 4, scattering: "all", fill: 1, brightness: 0 };

const SCATTERINGS = [
  ["all", "All light"],
  ["single", "Single scattering"],
  ["multiple", "Multiple scattering"],
];

export class SwatchViewer {
  constructor(fabric, number) {
    this.path = `api/swatches/${encodeURIComponent(fabric)}/${number}`;
    this.view = { ...START };
    this.inputs = new Map();
    this.image = el("img", { alt: `${fabric}@${number} as it is lit now`, draggable: "false", hidden: true });
    this.words = el("p", { class: "no-picture" }, "Drawing …");
    this.scale = el("span", { class: "scale" });
    this.status = el("p", { class: "small status", role: "status" });
    this.frame = el("div", { class: "frame", "data-state": "drawing" }, this.image, this.words, this.scale);
    this.pad = new TurningPad((change) => this.change(change));
    this.element = el("section", { class: "viewer", "aria-label": "Swatch" }, el("div", { class: "sight" }, this.frame, this.status, el("div", { class: "pad-part" }, this.pad.element, el("button", { type: "button", class: "link reset", on: { click: () => this.change({ ...START }) } }, "As it was"))), this.controls());
    this.viewer = Math.random().toString(36).slice(2);
    this.pixelsPerSecond = 160 * 160 / DRAFT_S;  // a guess, until the first one was drawn
    this.listenToDrags();
    this.show();
    this.order(false);
  }

  leave() {
    this.gone = true;
    clearTimeout(this.later);
    this.request?.abort();
    if (this.url) URL.revokeObjectURL(this.url);
  }

  controls() {
    const sharpness = this.range("sharpness", "Sharpness", 0, 100, 1, {
      to: (value) => (value >= 100 ? "parallel" : Math.round(2 ** (value / 10))),
      from: (value) => (value === "parallel" ? 100 : Math.round(10 * Math.log2(value))),
      text: (value) => (value === "parallel" ? "parallel" : value < 8 ? `${value}, soft` : value < 100 ? `${value}` : `${value}, hard`),
    });
    const degrees = { text: (value) => `${signed(Math.round(value))}°` };
    return el(
      "form",
      { class: "controls", on: { submit: (event) => event.preventDefault() } },
      el(
        "fieldset",
        {},
        el("legend", {}, "Light"),
        this.range("light_azimuth", "Around", -180, 180, 3, degrees),
        this.range("light_elevation", "Height", 3, 90, 3, degrees),
        sharpness,
        this.check("fill", "A faint soft light besides"),
      ),
      el(
        "fieldset",
        {},
        el("legend", {}, "Camera"),
        this.range("camera_azimuth", "Around", -180, 180, 3, degrees),
        this.range("camera_elevation", "Height", 15, 90, 3, degrees),
        this.range("height", "Shows", -20, 40, 1, { to: (value) => Number((10 ** (value / 20) * 1).toPrecision(2)), from: (value) => Math.round(20 * Math.log10(value)), text: (value) => `${value} mm` }),
        this.range("brightness", "Exposure", -3, 3, 0.25, { text: (value) => `${value > 0 ? "+" : ""}${signed(value)} stops` }),
      ),
      el(
        "fieldset",
        {},
        el("legend", {}, "Scattering"),
        SCATTERINGS.map(([value, label]) => this.radio("scattering", value, label)),
      ),
    );
  }

  range(name, label, min, max, step, { to = Number, from = Number, text }) {
    const id = `swatch-${name}`;
    const input = el("input", { type: "range", id, min, max, step, on: { input: () => this.change({ [name]: to(Number(input.value)) }) } });
    const output = el("output", { for: id });
    this.inputs.set(name, () => {
      input.value = from(this.view[name]);
      setText(output, text(this.view[name]));
      input.setAttribute("aria-valuetext", text(this.view[name]));
    });
    return el("div", { class: "control" }, el("label", { for: id }, label), input, output);
  }

  check(name, label) {
    const input = el("input", { type: "checkbox", id: `swatch-${name}`, on: { change: () => this.change({ [name]: input.checked ? 1 : 0 }) } });
    this.inputs.set(name, () => (input.checked = this.view[name] === 1));
    return el("label", { class: "choice" }, input, ` ${label}`);
  }

  radio(name, value, label) {
    const input = el("input", { type: "radio", name, value, on: { change: () => this.change({ [name]: value }) } });
    this.inputs.set(`${name} ${value}`, () => (input.checked = this.view[name] === value));
    return el("label", { class: "choice" }, input, ` ${label}`);
  }

  // Dragging the picture turns the camera.
  listenToDrags() {
    let last = null;
    this.frame.addEventListener("pointerdown", (event) => {
      last = [event.clientX, event.clientY];
      this.frame.setPointerCapture(event.pointerId);
    });
    this.frame.addEventListener("pointermove", (event) => {
      if (!last) return;
      const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]];
      last = [event.clientX, event.clientY];
      const elevation = Math.min(90, Math.max(15, this.view.camera_elevation + dy * 0.3));
      this.change({ camera_azimuth: wrapped(this.view.camera_azimuth - dx * 0.5), camera_elevation: elevation });
    });
    for (const name of ["pointerup", "pointercancel"]) this.frame.addEventListener(name, () => (last = null));
  }

  change(change) {
    Object.assign(this.view, change);
    this.show();
    this.order(true);
  }

  show() {
    for (const update of this.inputs.values()) update();
    this.pad.show(this.view);
    const length = SCALES_MM.findLast((mm) => mm <= this.view.height / 3) ?? SCALES_MM[0];
    this.scale.style.width = `${(100 * length) / this.view.height}%`;
    setText(this.scale, `${length} mm`);
  }

  // One picture at a time is asked for; of those wished for meanwhile, the last. A fine one that is
  // being drawn makes way.
  order(isMoving) {
    clearTimeout(this.later);
    this.wish = { ...this.view };
    this.isMoving = isMoving;
    if (this.isFine) this.request?.abort();
    if (!this.isDrawing) this.draw();
  }

  async draw() {
    this.isDrawing = true;
    this.frame.dataset.state = "drawing";
    while (this.wish && !this.gone) {
      const view = this.wish;
      this.wish = null;
      try {
        this.isFine = false;
        await this.drawOnce(view, this.sizeWithin(DRAFT_S), 1);
        if (this.isMoving) await pause(SETTLED_MS);
        this.isFine = true;
        // As large as it gets, with few samples and then with more.
        for (let samples = 1; !this.wish && samples; samples = this.samplesAfter(samples)) {
          await this.drawOnce(view, this.sizeWithin(FINE_S), samples);
        }
      } catch (problem) {
        if (this.gone) return;
        if (problem.name === "AbortError" || problem.code === "cancelled") continue;
        if (this.isFine && problem.code === "unavailable" && this.pixelsPerSecond > SLOWEST) {
          // It took too long: a smaller one will do.
          this.pixelsPerSecond /= 8;
          this.wish ??= view;
        } else if (problem.code === "resource_exhausted") {
          setText(this.status, "The render node is busy; trying again");
          await pause(RETRY_MS);
          this.wish ??= view;
        } else {
          this.isDrawing = false;
          this.isFine = false;
          this.frame.dataset.state = "failed";
          if (this.image.hidden) setText(this.words, "No picture");
          setText(this.status, sentence(problem.message));
          if (problem.code === "unavailable") this.later = setTimeout(() => this.order(false), AWAY_MS);
          return;
        }
      }
    }
    this.isFine = false;
    this.isDrawing = false;
    if (!this.gone) this.frame.dataset.state = "drawn";
  }

  sizeWithin(seconds) {
    return SIZES.findLast((size) => size * size <= seconds * this.pixelsPerSecond) ?? SIZES[0];
  }

  // Of the picture that follows one of so many; 0: none is worth the wait.
  samplesAfter(samples) {
    const size = this.sizeWithin(FINE_S);
    const most = Math.min(SAMPLES, Math.floor((FINE_S * this.pixelsPerSecond) / (size * size)));
    return most > samples ? most : 0;
  }

  async drawOnce({ brightness, ...view }, size, samples) {
    const stops = this.stops === undefined ? "auto" : this.stops + brightness;
    const query = new URLSearchParams({ ...view, size, samples, stops, viewer: this.viewer });
    this.request = new AbortController();
    const began = performance.now();
    const answer = await fetch(`${this.path}?${query}`, { signal: this.request.signal });
    if (!answer.ok) throw await problemOf(answer);
    this.stops ??= Number(answer.headers.get("X-Weft-Stops"));
    const url = URL.createObjectURL(await answer.blob());
    this.image.src = url;
    await this.image.decode();
    if (this.url) URL.revokeObjectURL(this.url);
    this.url = url;
    this.image.hidden = false;
    this.words.hidden = true;
    const seconds = (performance.now() - began) / 1000;
    // Loading the fabric, the first time, says nothing of the next picture.
    this.pixelsPerSecond = (size * size * samples) / Math.max(Number(answer.headers.get("X-Weft-Draw-Seconds")), 0.005);
    const grain = samples === 1 ? "1 sample" : `${samples} samples`;
    setText(this.status, `${size} × ${size} pixels, ${grain} each, in ${seconds.toFixed(2)} s on ${answer.headers.get("X-Weft-Device")}`);
  }
}

const signed = (value) => String(value).replace("-", "−");
const pause = (ms) => new Promise((done) => setTimeout(done, ms));

export function wrapped(degrees) {
  return ((((degrees + 180) % 360) + 360) % 360) - 180;
}
