// One version of a fabric: its swatch under a light that can be turned, and what is known of it.

import { difference } from "./difference.js";
import { el, fill } from "./dom.js";
import { bytes, hex, list, named, num, percent, when } from "./format.js";
import { ask } from "./live.js";
import { showTags } from "./page_fabrics.js";
import { SwatchViewer } from "./swatch.js";

export class VersionPage {
  section = "fabrics";

  constructor(live, fabric, number) {
    this.live = live;
    this.fabric = fabric;
    this.number = Number(number);
    this.title = `${fabric}@${number}`;
    this.viewer = new SwatchViewer(fabric, this.number);
    this.facts = el("dl", { class: "facts" });
    this.tags = el("span", { class: "tags", hidden: true });
    this.note = el("p", { class: "summary", hidden: true });
    this.compared = el("div", {});
    this.element = el(
      "div",
      {},
      el("p", { class: "crumbs" }, el("a", { href: "#/fabrics" }, "Fabrics"), " / ", el("a", { href: `#/fabrics/${fabric}` }, fabric)),
      el("div", { class: "title" }, el("h1", {}, `${fabric}@${number}`), this.tags),
      this.note,
      this.viewer.element,
      el("section", {}, el("h2", {}, "About this version"), this.facts, this.compared),
    );
    this.look();
  }

  leave() {
    this.viewer.leave();
  }

  async look() {
    try {
      const answer = await ask(`fabrics/${encodeURIComponent(this.fabric)}/versions`);
      const all = list(answer.versions);
      const version = all.find((each) => num(each.number) === this.number);
      if (!version) throw new Error(`${this.fabric} has no version ${this.number}.`);
      this.show(version, all);
    } catch (problem) {
      this.note.hidden = false;
      this.note.textContent = problem.message;
    }
  }

  show(version, all) {
    showTags(this.tags, list(version.tags));
    if (version.comment) {
      this.note.hidden = false;
      this.note.textContent = version.comment;
    }
    const size = num(version.size_bytes);
    const facts = [
      ["Published", `${when(num(version.published_at_ms))}${named(version.user) ? `, by ${version.user}` : ""}`],
      ["Size", `${bytes(size)}${num(version.shared_bytes) ? `, ${percent(num(version.shared_bytes) / size)} of it was on the disk before` : ""}`],
      version.carried_over_from ? ["Light", `carried over from ${version.carried_over_from}, not traced`] : ["Computed", `${num(version.computed_shards).toLocaleString("en")} shards, ${num(version.cached_shards).toLocaleString("en")} were known`],
      ["Made by", version.job_id ? el("a", { href: `#/jobs/${version.job_id}` }, version.job_id) : version.carried_over_from ? "weft recolor" : "an import"],
      ["Digest", el("code", {}, hex(version.content_digest, 16))],
      ["Fetch it", el("code", {}, `weft fetch ${this.fabric}@${this.number} -o ${this.fabric}.h5`)],
    ];
    fill(this.facts, facts.map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))));
    const before = num(version.parent) || num(all.find((other) => num(other.number) < this.number)?.number);
    if (before) {
      fill(
        this.compared,
        el("p", {}, el("button", { class: "link", type: "button", on: { click: (event) => difference(event.target, this.changes, `${this.fabric}@${before}`, `${this.fabric}@${this.number}`) } }, `What changed since @${before}`)),
        (this.changes = el("div", {})),
      );
    }
  }
}
