// Small pictures of versions, asked for two at a time: the render node draws one after the other.

import { el, setText } from "./dom.js";
import { problemOf } from "./live.js";

const AT_ONCE = 2;
const RETRY_MS = 1500;
const TRIES = 100;
const waiting = [];
let underWay = 0;

// A figure that becomes the version's swatch, or says why there is none.
export function thumbnail(fabric, number) {
  const words = el("span", { class: "no-picture" }, "…");
  const element = el("span", { class: "thumbnail" }, words);
  waiting.push({ element, words, path: `api/swatches/${encodeURIComponent(fabric)}/${number}?kind=thumbnail`, alt: `Swatch of ${fabric}@${number}`, tries: 0 });
  // Not before the page that it is for is shown.
  queueMicrotask(startNext);
  return element;
}

function startNext() {
  while (underWay < AT_ONCE && waiting.length > 0) {
    const order = waiting.shift();
    ++underWay;
    draw(order).finally(() => {
      --underWay;
      startNext();
    });
  }
}

async function draw(order) {
  if (!order.element.isConnected) return;
  try {
    const answer = await fetch(order.path);
    if (answer.ok) {
      const url = URL.createObjectURL(await answer.blob());
      const image = el("img", { src: url, alt: order.alt, on: { load: () => URL.revokeObjectURL(url) } });
      order.element.replaceChildren(image);
      return;
    }
    const problem = await problemOf(answer);
    if (problem.code === "resource_exhausted" && ++order.tries < TRIES) {
      setTimeout(() => {
        waiting.push(order);
        startNext();
      }, RETRY_MS);
      return;
    }
    order.element.title = problem.message;
    setText(order.words, problem.code === "failed_precondition" ? "no render node" : "no picture");
  } catch (problem) {
    order.element.title = problem.message;
    setText(order.words, "no picture");
  }
}
