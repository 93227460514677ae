// Why something waits: what holds it back, and what a person can do about it.

import { el, keyed, setAttribute, setText } from "./dom.js";
import { duration, num, sentence } from "./format.js";

export class ReasonList {
  constructor() {
    this.element = el("ul", { class: "reasons", hidden: true });
  }

  // `verdict` has been said: what it says need not be said again.
  update(all, nowMs, verdict = "") {
    const reasons = all.filter((reason) => reason.mend || !verdict.includes(reason.text));
    setAttribute(this.element, "hidden", reasons.length ? null : "");
    const keys = reasons.map((reason, at) => ({ reason, at }));
    keyed(this.element, keys, ({ reason, at }) => `${at} ${reason.code} ${reason.stage ?? ""} ${reason.worker ?? ""}`, () => new ReasonRow(nowMs, verdict));
  }
}

class ReasonRow {
  constructor(nowMs, verdict) {
    this.nowMs = nowMs;
    this.verdict = verdict;
    this.text = el("span", {});
    this.mend = el("span", { class: "mend" });
    this.element = el("li", {}, this.text, this.mend);
  }

  update({ reason }) {
    const left = (num(reason.until_ms) - this.nowMs) / 1000;
    const until = left > 0 ? ` (for about ${duration(left)} more)` : "";
    setAttribute(this.element, "data-code", reason.code);
    const isSaid = this.verdict.includes(reason.text) && until === "";
    setText(this.text, isSaid ? "" : `${sentence(reason.text + until)} `);
    setText(this.mend, sentence(reason.mend ?? ""));
  }
}
