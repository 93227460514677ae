// A job's tasks: the attempts at runs of shards, their logs, and why one shard is as it is.

import { el, fill, keyed, setAttribute, setText } from "./dom.js";
import { ago, duration, list, num, plural, sentence } from "./format.js";
import { ask } from "./live.js";
import { ReasonList } from "./reasons.js";
import { chip, updateChip } from "./stages.js";

const BETWEEN_LOOKS_MS = 2000;
const LOG_TAIL_BYTES = 32768;
const STAGES = ["geometry", "grid", "visibility", "basis", "coefficients", "transfer", "shadow"];

export class AttemptList {
  constructor(live, job) {
    this.live = live;
    this.job = job;
    this.lookedAt = 0;
    this.rows = el("ol", { class: "attempts" });
    this.note = el("p", { class: "small" });
    this.stage = el("select", { id: "stage", on: { change: () => this.look() } }, el("option", { value: "" }, "all stages"), STAGES.map((name) => el("option", { value: name }, name)));
    this.shard = el("input", { id: "shard", type: "number", min: "0", inputmode: "numeric", placeholder: "any", on: { change: () => this.look() } });
    this.verdict = el("p", { class: "verdict" });
    this.reasons = new ReasonList();
    this.element = el(
      "section",
      {},
      el("h2", { id: "tasks" }, "Tasks"),
      el("p", { class: "filter" }, el("label", { for: "stage" }, "Stage "), this.stage, el("label", { for: "shard" }, " Shard "), this.shard),
      this.verdict,
      this.reasons.element,
      this.note,
      this.rows,
    );
  }

  choose(stage) {
    this.stage.value = stage;
    this.look();
    this.stage.focus();
    this.element.scrollIntoView({ block: "start" });
  }

  // The job has changed: there may be others, but not more often than every two seconds.
  refresh(job) {
    this.isOver = num(job.ended_at_ms) > 0;
    const wait = this.lookedAt + BETWEEN_LOOKS_MS - Date.now();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.look(), Math.max(0, wait));
  }

  leave() {
    clearTimeout(this.timer);
    this.gone = true;
  }

  async look() {
    this.lookedAt = Date.now();
    const stage = this.stage.value;
    const shard = this.shard.value;
    const query = new URLSearchParams();
    if (stage) query.set("stage", stage);
    if (stage && shard !== "") query.set("shard", shard);
    try {
      const answer = await ask(`jobs/${this.job}/attempts?${query}`);
      if (this.gone) return;
      const attempts = list(answer.attempts);
      keyed(this.rows, attempts, (attempt) => attempt.name.attempt, (attempt) => new AttemptRow(this.live, this.job, attempt));
      setText(this.note, attempts.length === 0 ? "No attempt is known." : `${plural(attempts.length, "attempt")}, the newest first. Open one to read its log.`);
      await this.explain(stage, shard);
    } catch (problem) {
      setText(this.note, problem.message);
    }
  }

  async explain(stage, shard) {
    if (!stage || shard === "" || this.isOver) {
      setText(this.verdict, shard === "" || this.isOver || stage ? "" : "Choose the stage of that shard, too.");
      this.reasons.update([], 0);
      return;
    }
    const why = await ask(`jobs/${this.job}/explain?stage=${stage}&shard=${shard}`);
    setText(this.verdict, sentence(`${stage} ${shard}: ${why.verdict}`));
    this.reasons.update(list(why.reasons), this.live.now(), why.verdict);
  }
}

class AttemptRow {
  constructor(live, job, attempt) {
    this.live = live;
    this.job = job;
    this.number = attempt.name.attempt;
    this.outcome = chip("");
    this.what = el("span", { class: "what" });
    this.whose = el("span", { class: "whose" });
    this.times = el("span", { class: "times" });
    this.message = el("p", { class: "message", hidden: true });
    this.log = el("pre", { class: "log", tabindex: "0", "aria-label": "Log" });
    this.element = el("li", {}, el("details", { on: { toggle: (event) => this.toggle(event.target.open) } }, el("summary", {}, this.outcome, this.what, this.whose, this.times), this.message, this.log));
  }

  update(attempt) {
    this.isRunning = attempt.outcome === "running";
    updateChip(this.outcome, attempt.outcome);
    const first = num(attempt.first_shard);
    const last = first + num(attempt.shards) - 1;
    const purpose = attempt.purpose && attempt.purpose !== "first" ? ` (${attempt.purpose})` : "";
    setText(this.what, `${attempt.stage} ${first === last ? first : `${first}–${last}`}${purpose}`);
    setText(this.whose, `on ${attempt.worker}`);
    const began = num(attempt.began_at_ms);
    const ended = num(attempt.ended_at_ms);
    setText(this.times, ended ? `${ago(ended, this.live.now())}, took ${duration((ended - began) / 1000)}` : `for ${duration(Math.max(0, (this.live.now() - began) / 1000))}`);
    setAttribute(this.message, "hidden", attempt.message ? null : "");
    setText(this.message, attempt.message ?? "");
    if (this.isOpen && (this.isRunning || !this.isRead)) this.read();
  }

  leave() {
    this.isOpen = false;
  }

  toggle(isOpen) {
    this.isOpen = isOpen;
    if (isOpen) this.read();
  }

  async read() {
    const query = this.next === undefined ? `last=${LOG_TAIL_BYTES}` : `offset=${this.next}`;
    try {
      const answer = await fetch(`api/jobs/${this.job}/attempts/${this.number}/log?${query}`);
      if (!answer.ok) throw new Error(`The log cannot be read (${answer.status}).`);
      const text = await answer.text();
      const isFirst = this.next === undefined;
      this.next = num(answer.headers.get("X-Weft-Next"));
      if (isFirst) fill(this.log);
      if (text) this.log.append(text);
      else if (isFirst) this.log.append(this.isRunning ? "Nothing was logged yet." : "It logged nothing.");
      if (isFirst && !text) this.next = undefined;
      this.isRead = !this.isRunning;
      this.log.scrollTop = this.log.scrollHeight;
    } catch (problem) {
      setText(this.log, problem.message);
    }
  }
}
