// What changed from one version to another.

import { el, fill, setText } from "./dom.js";
import { bytes, figure, list, num, percent, plural } from "./format.js";
import { ask } from "./live.js";

// Compares when `button` was pressed; what comes of it is shown in `place`.
export async function difference(button, place, from, to) {
  button.disabled = true;
  setText(button, "Comparing …");
  try {
    const answer = await ask(`diff?from=${encodeURIComponent(from)}&to=${encodeURIComponent(to)}`);
    fill(place, fieldsOf(list(answer.fields)), datasetsOf(list(answer.datasets)), el("p", { class: "small" }, sharedOf(answer)));
    button.remove();
  } catch (problem) {
    button.disabled = false;
    setText(button, "Compare again");
    fill(place, el("p", { class: "message" }, problem.message));
  }
}

function sharedOf(answer) {
  const size = num(answer.to.size_bytes);
  return `Of ${bytes(size)}, ${percent(num(answer.shared_bytes) / Math.max(1, size))} are the same pieces.`;
}

function table(caption, head, rows) {
  return el("div", { class: "wide" }, el("table", {}, el("caption", {}, caption), el("thead", {}, el("tr", {}, head.map((name) => el("th", { scope: "col" }, name)))), el("tbody", {}, rows)));
}

function fieldsOf(fields) {
  if (fields.length === 0) return el("p", {}, "The descriptions are equal.");
  return table(
    "Of the description",
    ["Field", "From", "To"],
    fields.map((field) => el("tr", {}, el("th", { scope: "row" }, el("code", {}, field.path)), el("td", {}, field.from || "–"), el("td", {}, field.to || "–"))),
  );
}

// Only of numbers it is said by how much they differ.
function isText(dataset) {
  return dataset.shape_from === dataset.shape_to && num(dataset.largest_difference) === 0;
}

function datasetsOf(datasets) {
  const other = datasets.filter((dataset) => !dataset.equal);
  if (other.length === 0) return el("p", {}, "The data are equal.");
  return table(
    `${plural(other.length, "dataset")} of ${datasets.length} differ`,
    ["Dataset", "Differs by (rms)", "of (rms)", "at most"],
    other.map((dataset) =>
      el(
        "tr",
        {},
        el("th", { scope: "row" }, el("code", {}, dataset.path)),
        isText(dataset)
          ? el("td", { colspan: 3 }, "another text")
          : dataset.shape_from === dataset.shape_to
          ? [dataset.rms_difference, dataset.rms_from, dataset.largest_difference].map((value) => el("td", { class: "figure" }, figure(num(value))))
          : el("td", { colspan: 3 }, `${dataset.shape_from || "nothing"} became ${dataset.shape_to || "nothing"}`),
      ),
    ),
  );
}
