// How far a job is: its stages side by side, and in words.

import { el, setAttribute, setText } from "./dom.js";
import { duration, list, num, percent, rate, word } from "./format.js";

const NAMES = ["geometry", "grid", "visibility", "basis", "coefficients", "transfer", "shadow"];

export function stateOf(stage) {
  return word(stage.state, "STAGE_STATE");
}

export function fractionOf(stage) {
  return stateOf(stage) === "done" ? 1 : Math.min(1, num(stage.fraction_done));
}

// A strip of seven pieces that fill as their stages get on.
export class StageStrip {
  constructor() {
    this.pieces = NAMES.map(() => el("i", {}));
    this.element = el("div", { class: "strip", role: "img" }, this.pieces.map((piece) => el("span", {}, piece)));
  }

  update(job) {
    const stages = list(job.stages);
    const said = [];
    this.pieces.forEach((piece, at) => {
      const stage = stages.find((each) => each.name === NAMES[at]) ?? {};
      const fraction = fractionOf(stage);
      piece.style.width = `${100 * fraction}%`;
      setAttribute(piece.parentElement, "data-state", stateOf(stage));
      setAttribute(piece.parentElement, "title", `${NAMES[at]}: ${percent(fraction)}`);
      said.push(`${NAMES[at]} ${percent(fraction)}`);
    });
    setAttribute(this.element, "aria-label", said.join(", "));
  }
}

export function jobState(job) {
  return job.paused && !num(job.ended_at_ms) ? "paused" : word(job.state, "JOB_STATE");
}

// "visibility 40 % · 12 shards/s · 3 min left in it"
export function inWords(job) {
  if (job.error) return job.error.split("\n")[0];
  const state = jobState(job);
  if (state === "paused") return "It stands still until somebody resumes it";
  const running = list(job.stages).filter((stage) => stateOf(stage) === "running" && num(stage.shards) > 0);
  if (running.length > 0) {
    return running.map(stageInWords).join("; ");
  }
  if (job.waiting_for) return `Waits for ${job.waiting_for}`;
  if (state === "committing") return "All results are there; the database is being written";
  if (state === "succeeded" && job.version) {
    return `Published as ${job.version.fabric}@${num(job.version.number)}`;
  }
  return state === "running" ? "The next stage is being planned" : "";
}

function stageInWords(stage) {
  const parts = [`${stage.name} ${percent(fractionOf(stage))}`];
  if (num(stage.shards_per_second) > 0) parts.push(rate(num(stage.shards_per_second)));
  if (num(stage.seconds_left) > 0) parts.push(`${duration(num(stage.seconds_left))} left in it`);
  return parts.join(" · ");
}

export function chip(state) {
  return el("span", { class: "chip", "data-state": state }, state);
}

export function updateChip(element, state) {
  setText(element, state);
  setAttribute(element, "data-state", state);
}
