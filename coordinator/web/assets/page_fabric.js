// The versions of a fabric, what changed between them, and its history.

import { el, fill, setAttribute, setText } from "./dom.js";
import { bytes, list, named, num, percent, plural, when } from "./format.js";
import { ask } from "./live.js";
import { difference } from "./difference.js";
import { nodeNotice } from "./node.js";
import { showTags } from "./page_fabrics.js";
import { thumbnail } from "./thumbnails.js";

export class FabricPage {
  section = "fabrics";

  constructor(live, fabric) {
    this.live = live;
    this.fabric = fabric;
    this.title = fabric;
    this.versions = el("ol", { class: "versions" }, el("li", {}, "Looking …"));
    this.history = el("ol", { class: "history" });
    this.historyPart = el("section", { hidden: true }, el("h2", {}, "History"), this.history);
    this.element = el("div", {}, el("p", { class: "crumbs" }, el("a", { href: "#/fabrics" }, "Fabrics")), el("h1", {}, fabric), nodeNotice(), this.versions, this.historyPart);
  }

  // Versions are listed anew when the fabric got another one, or another tag.
  take(name, value) {
    if (name !== "fabrics") return;
    const mine = JSON.stringify(list(value.fabrics).find((fabric) => fabric.name === this.fabric) ?? null);
    if (mine !== this.seen) {
      this.seen = mine;
      this.look();
    }
  }

  async look() {
    try {
      const path = `fabrics/${encodeURIComponent(this.fabric)}`;
      const [versions, history] = await Promise.all([ask(`${path}/versions`), ask(`${path}/history`)]);
      const all = list(versions.versions);
      fill(this.versions, all.map((version) => this.versionOf(version, all)));
      const entries = list(history.entries);
      setAttribute(this.historyPart, "hidden", entries.length ? null : "");
      fill(this.history, entries.map((entry) => this.entryOf(entry)));
    } catch (problem) {
      fill(this.versions, el("li", {}, problem.message));
    }
  }

  versionOf(version, all) {
    const number = num(version.number);
    const tags = el("span", { class: "tags" });
    showTags(tags, list(version.tags));
    const before = num(version.parent) || num(all.find((other) => num(other.number) < number)?.number);
    const compared = el("div", {});
    const computed = num(version.computed_shards);
    const cached = num(version.cached_shards);
    const about = [
      bytes(num(version.size_bytes)),
      num(version.shared_bytes) ? `${percent(num(version.shared_bytes) / num(version.size_bytes))} of it was on the disk before` : null,
      version.carried_over_from ? `its light was carried over from ${version.carried_over_from}` : null,
      computed + cached > 0 ? `${plural(computed, "shard")} computed, ${cached.toLocaleString("en")} known` : null,
    ].filter(Boolean);
    const compare = before
      ? el("button", { class: "link", type: "button", on: { click: (event) => difference(event.target, compared, `${this.fabric}@${before}`, `${this.fabric}@${number}`) } }, `What changed since @${before}`)
      : null;
    return el(
      "li",
      {},
      el("a", { href: `#/fabrics/${this.fabric}/${number}`, class: "picture", tabindex: "-1", "aria-hidden": "true" }, thumbnail(this.fabric, number)),
      el(
        "div",
        {},
        el("div", { class: "line" }, el("a", { class: "name", href: `#/fabrics/${this.fabric}/${number}` }, `@${number}`), tags),
        version.comment ? el("p", { class: "comment" }, version.comment) : null,
        el("p", { class: "small" }, `${when(num(version.published_at_ms))}${named(version.user) ? ` by ${version.user}` : ""} · ${about.join(" · ")}`),
        compare ? el("p", { class: "small" }, compare) : null,
        compared,
      ),
    );
  }

  entryOf(entry) {
    const number = num(entry.number);
    const what = { published: `@${number} was published`, tagged: `@${number} got the tag ${entry.tag}`, untagged: `@${number} lost the tag ${entry.tag}`, rolled_back: `@${number} became the latest again` }[entry.action] ?? `${entry.action} @${number}`;
    return el("li", {}, el("time", {}, when(num(entry.at_ms))), ` ${what}${named(entry.user) ? `, by ${entry.user}` : ""}${entry.comment ? `: ${entry.comment}` : ""}`);
  }
}
