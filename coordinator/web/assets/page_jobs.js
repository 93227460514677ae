// All jobs at a glance.

import { el, keyed, setAttribute, setText } from "./dom.js";
import { ago, duration, list, named, num, plural } from "./format.js";
import { StageStrip, chip, inWords, jobState, updateChip } from "./stages.js";

export class JobsPage {
  title = "Jobs";
  section = "jobs";

  constructor(live) {
    this.live = live;
    this.summary = el("p", { class: "summary", "aria-live": "polite" }, "Looking …");
    this.running = el("ul", { class: "jobs" });
    this.ended = el("ul", { class: "jobs quiet" });
    this.endedPart = el("section", { hidden: true }, el("h2", {}, "Ended"), this.ended);
    this.empty = el(
      "p",
      { class: "notice", hidden: true },
      "Nothing was submitted yet. ",
      el("code", {}, "weft submit FABRIC.textproto"),
      " queues the precomputation of a fabric.",
    );
    this.element = el("div", {}, el("h1", {}, "Jobs"), this.summary, this.empty, this.running, this.endedPart);
  }

  take(name, value) {
    if (name === "jobs") this.jobs = value;
    if (name === "workers") this.workers = value;
    if (name === "jobs" || name === "workers") this.show();
  }

  tick() {
    if (this.jobs) this.show();
  }

  show() {
    if (!this.jobs) return;
    const jobs = list(this.jobs.list.jobs);
    const unfinished = jobs.filter((job) => !num(job.ended_at_ms));
    const ended = jobs.filter((job) => num(job.ended_at_ms));
    const make = (job) => new JobRow(this.live, job);
    keyed(this.running, unfinished, (job) => job.id, make);
    keyed(this.ended, ended, (job) => job.id, make);
    setAttribute(this.endedPart, "hidden", ended.length === 0 ? "" : null);
    setAttribute(this.empty, "hidden", jobs.length > 0 ? "" : null);
    setText(this.summary, this.sentence(unfinished));
  }

  sentence(unfinished) {
    const total = num(this.jobs.unfinished);
    const moving = unfinished.filter((job) => ["running", "committing"].includes(jobState(job)) && !job.waiting_for);
    const live = list(this.workers?.workers).filter((worker) => !worker.lost);
    const idle = live.filter((worker) => list(worker.attempts).length === 0);
    const crew = this.workers
      ? live.length === 0
        ? "No worker is there."
        : `${plural(live.length, "worker")}, ${idle.length === 0 ? "all at work" : idle.length === live.length ? "idle" : `${idle.length} of them idle`}.`
      : "";
    if (total === 0) return `Nothing is to be done. ${crew}`;
    const shown = unfinished.length < total ? ` The first ${unfinished.length} are shown.` : "";
    const waiting = total - moving.length;
    const what = moving.length === 0 ? `${plural(total, "job")} ${total === 1 ? "waits" : "wait"}.` : `${plural(moving.length, "job")} under way${waiting > 0 ? `, ${waiting} waiting` : ""}.`;
    return `${what} ${crew}${shown}`;
  }
}

class JobRow {
  constructor(live, job) {
    this.live = live;
    this.name = el("a", { class: "name", href: `#/jobs/${job.id}` }, job.fabric);
    this.state = chip("");
    this.comment = el("span", { class: "comment" });
    this.strip = new StageStrip();
    this.words = el("span", { class: "words" });
    this.aside = el("span", { class: "aside" });
    this.element = el(
      "li",
      { "data-job": job.id },
      el("div", { class: "line" }, this.name, this.comment, this.state),
      this.strip.element,
      el("div", { class: "line small" }, this.words, this.aside),
    );
  }

  update(job) {
    const state = jobState(job);
    const isEnded = num(job.ended_at_ms) > 0;
    updateChip(this.state, state);
    setAttribute(this.element, "data-state", state);
    setText(this.comment, job.comment ?? "");
    setAttribute(this.strip.element, "hidden", isEnded ? "" : null);
    if (!isEnded) this.strip.update(job);
    setText(this.words, inWords(job));
    const user = named(job.user) ? `${job.user} · ` : "";
    const priority = num(job.priority) ? ` · priority ${num(job.priority)}` : "";
    setText(
      this.aside,
      isEnded
        ? `${user}${ago(num(job.ended_at_ms), this.live.now())}, took ${duration((num(job.ended_at_ms) - num(job.submitted_at_ms)) / 1000)}`
        : `${user}submitted ${ago(num(job.submitted_at_ms), this.live.now())}${priority}`,
    );
  }
}
