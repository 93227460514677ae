// The hemisphere above the cloth, seen from straight above: where the light is, and where the
// camera. Both can be dragged; the sliders beside it do the same from the keyboard.

import { el } from "./dom.js";

const RADIANS = Math.PI / 180;

export class TurningPad {
  constructor(onChange) {
    this.onChange = onChange;
    this.marks = { light: el("span", { class: "mark light" }), camera: el("span", { class: "mark camera" }) };
    this.disc = el("div", { class: "pad", "aria-hidden": "true" }, this.marks.camera, this.marks.light);
    this.element = el("figure", { class: "pad-figure" }, this.disc, el("figcaption", { class: "small" }, el("span", { class: "key light" }), " light ", el("span", { class: "key camera" }), " camera, from above"));
    this.listen();
  }

  show(view) {
    this.view = view;
    for (const [name, mark] of Object.entries(this.marks)) {
      const radius = 50 * Math.cos(view[`${name}_elevation`] * RADIANS);
      const angle = view[`${name}_azimuth`] * RADIANS;
      mark.style.left = `${50 + radius * Math.cos(angle)}%`;
      mark.style.top = `${50 - radius * Math.sin(angle)}%`;
    }
  }

  listen() {
    let held = null;
    this.disc.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      held = event.target === this.marks.camera ? "camera" : "light";
      this.disc.setPointerCapture(event.pointerId);
      this.turn(held, event);
    });
    this.disc.addEventListener("pointermove", (event) => held && this.turn(held, event));
    for (const name of ["pointerup", "pointercancel"]) this.disc.addEventListener(name, () => (held = null));
  }

  turn(name, event) {
    const box = this.disc.getBoundingClientRect();
    const x = (2 * (event.clientX - box.left)) / box.width - 1;
    const y = 1 - (2 * (event.clientY - box.top)) / box.height;
    const radius = Math.min(1, Math.hypot(x, y));
    const lowest = name === "camera" ? 15 : 3;
    const elevation = Math.max(lowest, Math.round(Math.acos(radius) / RADIANS));
    const azimuth = radius < 0.02 ? this.view[`${name}_azimuth`] : Math.round(Math.atan2(y, x) / RADIANS);
    this.onChange({ [`${name}_azimuth`]: azimuth, [`${name}_elevation`]: elevation });
  }
}
