// All fabrics, each with a swatch of its latest version.

import { el, keyed, setAttribute, setText } from "./dom.js";
import { ago, list, num, plural } from "./format.js";
import { nodeNotice } from "./node.js";
import { thumbnail } from "./thumbnails.js";

export class FabricsPage {
  title = "Fabrics";
  section = "fabrics";

  constructor(live) {
    this.live = live;
    this.summary = el("p", { class: "summary" }, "Looking …");
    this.grid = el("ul", { class: "fabrics" });
    this.element = el("div", {}, el("h1", {}, "Fabrics"), this.summary, nodeNotice(), this.grid);
  }

  take(name, value) {
    if (name !== "fabrics") return;
    this.fabrics = list(value.fabrics);
    this.show();
  }

  tick() {
    if (this.fabrics) this.show();
  }

  show() {
    const fabrics = this.fabrics;
    setText(this.summary, fabrics.length ? `${plural(fabrics.length, "fabric")}, ${plural(fabrics.reduce((sum, fabric) => sum + num(fabric.versions), 0), "version")}.` : "Nothing was published yet: a job that succeeds publishes a version of its fabric.");
    keyed(this.grid, fabrics, (fabric) => `${fabric.name}@${num(fabric.latest.number)}`, (fabric) => new FabricCard(this.live, fabric));
  }
}

class FabricCard {
  constructor(live, fabric) {
    this.live = live;
    const number = num(fabric.latest.number);
    this.versions = el("span", { class: "small" });
    this.tags = el("span", { class: "tags" });
    this.element = el(
      "li",
      {},
      el("a", { href: `#/fabrics/${fabric.name}/${number}`, class: "picture", tabindex: "-1", "aria-hidden": "true" }, thumbnail(fabric.name, number)),
      el("a", { class: "name", href: `#/fabrics/${fabric.name}` }, fabric.name),
      this.versions,
      this.tags,
    );
  }

  update(fabric) {
    const latest = fabric.latest;
    setText(this.versions, `${plural(num(fabric.versions), "version")}, the latest @${num(latest.number)} ${ago(num(latest.published_at_ms), this.live.now())}`);
    showTags(this.tags, list(latest.tags));
  }
}

export function showTags(element, tags) {
  setAttribute(element, "hidden", tags.length ? null : "");
  keyed(element, tags, (tag) => tag, (tag) => ({ element: el("span", { class: "tag" }, tag) }));
}
