// Whether there is something that draws swatches, in words.

import { el, setAttribute, setText } from "./dom.js";
import { ask } from "./live.js";

// A notice that shows itself when no render node draws.
export function nodeNotice() {
  const element = el("p", { class: "notice", role: "status", hidden: true });
  ask("node").then(
    (node) => {
      const text = noticeOf(node);
      setText(element, text);
      setAttribute(element, "hidden", text ? null : "");
    },
    () => {},
  );
  return element;
}

function noticeOf(node) {
  if (!node.configured) {
    return "No render node draws swatches. Start one with weft-render, and the coordinator with --render-node and its address.";
  }
  return node.answers ? "" : `Swatches cannot be drawn now: ${node.problem}`;
}
