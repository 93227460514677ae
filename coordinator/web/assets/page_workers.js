// The workers: what each does, and when it was last heard of.

import { el, fill, keyed, setAttribute, setText } from "./dom.js";
import { ago, bytes, duration, list, num, plural, sentence } from "./format.js";
import { ask } from "./live.js";
import { ReasonList } from "./reasons.js";
import { chip, updateChip } from "./stages.js";

export class WorkersPage {
  title = "Workers";
  section = "workers";

  constructor(live) {
    this.live = live;
    this.summary = el("p", { class: "summary", "aria-live": "polite" }, "Looking …");
    this.list = el("ul", { class: "workers" });
    this.element = el("div", {}, el("h1", {}, "Workers"), this.summary, this.list);
  }

  take(name, value) {
    if (name !== "workers") return;
    this.workers = list(value.workers);
    this.show();
  }

  tick() {
    if (this.workers) this.show();
  }

  show() {
    keyed(this.list, this.workers, (worker) => worker.id, () => new WorkerRow(this.live));
    const live = this.workers.filter((worker) => !worker.lost);
    const busy = live.filter((worker) => list(worker.attempts).length > 0);
    const threads = live.reduce((sum, worker) => sum + num(worker.threads), 0);
    const lost = this.workers.length - live.length;
    setText(
      this.summary,
      this.workers.length === 0
        ? "No worker was heard of within the last ten minutes. weft-worker --coordinator HOST:PORT starts one."
        : `${plural(live.length, "worker")} with ${plural(threads, "thread")}, ${busy.length || "none"} at work.${lost ? ` ${plural(lost, "worker")} fell silent.` : ""}`,
    );
  }
}

function conditionOf(worker) {
  if (worker.lost) return "lost";
  if (worker.undelivered) return "cannot deliver";
  if (worker.drained) return "drained";
  if (list(worker.blocked_stages).length) return "blocked";
  return list(worker.attempts).length ? "at work" : "idle";
}

class WorkerRow {
  constructor(live) {
    this.live = live;
    this.name = el("h2", { class: "name" });
    this.state = chip("");
    this.machine = el("p", { class: "small" });
    this.trouble = el("p", { class: "message", hidden: true });
    this.attempts = el("ul", { class: "runs" });
    this.verdict = el("p", { class: "verdict" });
    this.reasons = new ReasonList();
    this.why = el("button", { class: "link", type: "button", on: { click: () => this.explain() } }, "Why?");
    this.element = el("li", {}, el("div", { class: "line" }, this.name, this.state, this.why), this.machine, this.trouble, this.attempts, this.verdict, this.reasons.element);
  }

  update(worker) {
    this.id = worker.id;
    const condition = conditionOf(worker);
    setText(this.name, worker.name);
    updateChip(this.state, condition);
    setAttribute(this.element, "data-worker", worker.name);
    setAttribute(this.why, "aria-label", `Why is ${worker.name} ${condition}?`);
    const parts = [
      plural(num(worker.threads), "thread"),
      bytes(num(worker.memory_bytes)),
      `heard of ${ago(num(worker.last_seen_at_ms), this.live.now())}`,
      `${plural(num(worker.shards_done), "shard")} done`,
    ];
    if (num(worker.failures)) parts.push(plural(num(worker.failures), "failure"));
    if (num(worker.wall_left_ms)) parts.push(`may run for ${duration(num(worker.wall_left_ms) / 1000)} more`);
    if (list(worker.labels).length) parts.push(list(worker.labels).join(", "));
    setText(this.machine, parts.join(" · "));
    const blocked = list(worker.blocked_stages);
    const trouble = worker.undelivered || (blocked.length ? `It is given no ${blocked.join(", ")} any more: those tasks failed here and passed elsewhere.` : "");
    setAttribute(this.trouble, "hidden", trouble ? null : "");
    setText(this.trouble, trouble);
    keyed(this.attempts, list(worker.attempts), (attempt) => `${attempt.name.job_id} ${attempt.name.attempt}`, () => new RunRow());
  }

  async explain() {
    try {
      const why = await ask(`workers/${encodeURIComponent(this.id)}/explain`);
      setText(this.verdict, sentence(why.verdict));
      this.reasons.update(list(why.reasons), this.live.now(), why.verdict);
    } catch (problem) {
      setText(this.verdict, problem.message);
    }
  }
}

class RunRow {
  constructor() {
    this.what = el("span", {});
    this.bar = el("i", {});
    this.lastLine = el("span", { class: "last-line" });
    this.element = el("li", {}, this.what, el("span", { class: "bar" }, this.bar), this.lastLine);
  }

  update(attempt) {
    const first = num(attempt.first_shard);
    const count = num(attempt.shards);
    const done = num(attempt.shards_done);
    fill(this.what, el("a", { href: `#/jobs/${attempt.name.job_id}` }, attempt.fabric), ` ${attempt.stage} ${count === 1 ? first : `${first}–${first + count - 1}`}, ${done} of ${count}`);
    this.bar.style.width = `${(100 * done) / Math.max(1, count)}%`;
    setText(this.lastLine, attempt.last_line ?? "");
  }
}
