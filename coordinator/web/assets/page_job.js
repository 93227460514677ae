// One job: why it moves or waits, its stages, what went wrong, its attempts and their logs.

import { AttemptList } from "./attempts.js";
import { el, fill, keyed, setAttribute, setText } from "./dom.js";
import { ago, bytes, duration, list, named, num, percent, plural, rate, sentence, when, word } from "./format.js";
import { ReasonList } from "./reasons.js";
import { chip, fractionOf, jobState, stateOf, updateChip } from "./stages.js";

export class JobPage {
  section = "jobs";

  constructor(live, job) {
    this.live = live;
    this.job = job;
    this.title = `Job ${job}`;
    this.heading = el("h1", {}, job);
    this.state = chip("");
    this.about = el("p", { class: "about" });
    this.comment = el("p", { class: "comment" });
    this.verdict = el("p", { class: "summary", "aria-live": "polite" });
    this.reasons = new ReasonList();
    this.version = el("p", { class: "summary", hidden: true });
    this.error = el("pre", { class: "error", hidden: true });
    this.stages = el("tbody");
    this.troubles = el("ul", { class: "troubles" });
    this.troublesPart = el("section", { hidden: true }, el("h2", {}, "Trouble"), this.troubles);
    this.attempts = new AttemptList(live, job);
    this.counts = el("p", { class: "small" });
    this.element = el(
      "div",
      {},
      el("p", { class: "crumbs" }, el("a", { href: "#/" }, "Jobs")),
      el("div", { class: "title" }, this.heading, this.state),
      this.about,
      this.comment,
      this.verdict,
      this.version,
      this.error,
      this.reasons.element,
      el(
        "section",
        {},
        el("h2", {}, "Stages"),
        el(
          "div",
          { class: "wide" },
          el(
            "table",
            { class: "stages" },
            el("thead", {}, el("tr", {}, ["Stage", "Progress", "Shards", "Rate", "Left"].map((name) => el("th", { scope: "col" }, name)))),
            this.stages,
          ),
        ),
        this.counts,
      ),
      this.troublesPart,
      this.attempts.element,
    );
  }

  take(name, value) {
    if (name === "job") this.show(value.job);
    if (name === "explain") {
      setText(this.verdict, sentence(value.verdict));
      this.reasons.update(list(value.reasons).filter((reason) => reason.code !== "ended"), this.live.now(), value.verdict);
    }
  }

  tick() {
    if (this.shown) this.showAbout(this.shown);
  }

  leave() {
    this.attempts.leave();
  }

  show(job) {
    this.shown = job;
    setText(this.heading, job.fabric);
    document.title = `${job.fabric} · weft`;
    updateChip(this.state, jobState(job));
    this.showAbout(job);
    const version = job.version;
    setAttribute(this.version, "hidden", version ? null : "");
    if (version && !this.version.firstChild) {
      const reference = `${version.fabric}@${num(version.number)}`;
      this.version.append("Published as ", el("a", { href: `#/fabrics/${version.fabric}/${num(version.number)}` }, reference), ".");
    }
    // What became of it is said by one of these two.
    setAttribute(this.verdict, "hidden", version || job.error ? "" : null);
    setAttribute(this.error, "hidden", job.error ? null : "");
    setText(this.error, job.error ?? "");
    keyed(this.stages, list(job.stages), (stage) => stage.name, () => new StageRow((name) => this.attempts.choose(name)));
    setText(this.counts, countsOf(job));
    const troubles = list(job.troubles);
    setAttribute(this.troublesPart, "hidden", troubles.length ? null : "");
    fill(this.troubles, troubles.map(troubleOf));
    this.attempts.refresh(job);
  }

  showAbout(job) {
    const parts = [job.id];
    if (named(job.user)) parts.push(`for ${job.user}`);
    parts.push(`submitted ${ago(num(job.submitted_at_ms), this.live.now())}`);
    if (num(job.ended_at_ms)) parts.push(`ended ${when(num(job.ended_at_ms))}, after ${duration((num(job.ended_at_ms) - num(job.submitted_at_ms)) / 1000)}`);
    if (num(job.priority)) parts.push(`priority ${num(job.priority)}`);
    if (list(job.labels).length) parts.push(`wants ${list(job.labels).join(", ")}`);
    setText(this.about, parts.join(" · "));
    setText(this.comment, job.comment ?? "");
  }
}

function countsOf(job) {
  const parts = [];
  if (num(job.cached_bytes)) parts.push(`${bytes(num(job.cached_bytes))} of results were there already`);
  if (num(job.speculative_attempts)) parts.push(`${plural(num(job.speculative_attempts), "attempt")} to outrun a slow one`);
  if (num(job.audited_shards)) parts.push(`${plural(num(job.audited_shards), "result")} confirmed by a second worker`);
  if (num(job.audits_given_up)) parts.push(`${plural(num(job.audits_given_up), "result")} that no second worker could confirm`);
  return parts.join(" · ");
}

function troubleOf(trouble) {
  const where = `${trouble.stage}, shard ${num(trouble.shard)}`;
  const liar = trouble.liar ? ` ${trouble.liar} was wrong.` : "";
  return el("li", {}, el("strong", {}, `${word(trouble.kind, "KIND")}: ${where}. `), `${trouble.message ?? ""}${liar}`);
}

class StageRow {
  constructor(choose) {
    this.name = el("button", { class: "link", type: "button", on: { click: () => choose(this.stage) } });
    this.bar = el("i", {});
    this.share = el("span", { class: "share" });
    this.shards = el("td", { class: "figure" });
    this.rate = el("td", { class: "figure" });
    this.left = el("td", { class: "figure" });
    this.lastLine = el("span", { class: "last-line" });
    this.element = el(
      "tr",
      {},
      el("th", { scope: "row" }, this.name),
      el("td", { class: "progress" }, el("div", { class: "gauge" }, el("span", { class: "bar" }, this.bar), this.share), this.lastLine),
      this.shards,
      this.rate,
      this.left,
    );
  }

  update(stage) {
    this.stage = stage.name;
    const state = stateOf(stage);
    const fraction = fractionOf(stage);
    setAttribute(this.element, "data-state", state);
    setText(this.name, stage.name);
    setAttribute(this.name, "title", `Show the attempts at ${stage.name}`);
    this.bar.style.width = `${100 * fraction}%`;
    setText(this.share, state === "waiting" ? "waits" : state === "done" ? "done" : percent(fraction));
    setText(this.lastLine, stage.last_line ?? "");
    const cached = num(stage.shards_cached);
    const failures = num(stage.failures);
    setText(
      this.shards,
      num(stage.shards) === 0
        ? "–"
        : `${num(stage.shards_done).toLocaleString("en")} / ${num(stage.shards).toLocaleString("en")}` +
            (cached ? `, ${cached.toLocaleString("en")} known` : "") +
            (failures ? `, ${plural(failures, "failure")}` : ""),
    );
    setText(this.rate, num(stage.shards_per_second) > 0 ? rate(num(stage.shards_per_second)) : "–");
    const took = (num(stage.ended_at_ms) - num(stage.started_at_ms)) / 1000;
    setText(this.left, state === "done" ? (took > 0 ? `took ${duration(took)}` : "–") : num(stage.seconds_left) > 0 ? duration(num(stage.seconds_left)) : "–");
  }
}
