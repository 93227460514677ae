// Which page is shown: the part of the address behind '#' names it.

import { el, setText } from "./dom.js";
import { Live } from "./live.js";
import { FabricPage } from "./page_fabric.js";
import { FabricsPage } from "./page_fabrics.js";
import { JobPage } from "./page_job.js";
import { JobsPage } from "./page_jobs.js";
import { VersionPage } from "./page_version.js";
import { WorkersPage } from "./page_workers.js";

const main = document.getElementById("main");
const connection = document.getElementById("connection");
let page = null;

const live = new Live(
  (name, value) => page?.take?.(name, value),
  (state, text) => {
    connection.dataset.state = state;
    setText(connection, text);
  },
);

// A page has a title, an element, the section it belongs to and, of a job, its id; `take` gets the
// events of the stream, `tick` is called every second, `leave` when another page is shown.
function pageOf(parts) {
  if (parts.length === 0) return new JobsPage(live);
  if (parts[0] === "jobs" && parts.length === 2) return new JobPage(live, parts[1]);
  if (parts[0] === "workers" && parts.length === 1) return new WorkersPage(live);
  if (parts[0] === "fabrics" && parts.length === 1) return new FabricsPage(live);
  if (parts[0] === "fabrics" && parts.length === 2) return new FabricPage(live, parts[1]);
  if (parts[0] === "fabrics" && parts.length === 3) return new VersionPage(live, parts[1], parts[2]);
  const element = el("div", {}, el("h1", {}, "Nothing is here"), el("p", {}, "The address names no page. ", el("a", { href: "#/" }, "To the jobs")));
  return { title: "Nothing is here", section: "", element };
}

function show() {
  const hash = location.hash;
  if (hash === "#main") {
    main.focus();
    return;
  }
  const parts = hash.replace(/^#\/?/, "").split("/").filter(Boolean).map(decodeURIComponent);
  const isFirst = page === null;
  page?.leave?.();
  page = pageOf(parts);
  document.title = `${page.title} · weft`;
  main.replaceChildren(page.element);
  for (const link of document.querySelectorAll("nav [data-section]")) {
    if (link.dataset.section === page.section) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  live.watch(page.job ?? "");
  for (const name of ["jobs", "workers", "fabrics", "job", "explain"]) {
    const value = live.last(name);
    if (value) page.take?.(name, value);
  }
  if (!isFirst) {
    scrollTo(0, 0);
    main.focus({ preventScroll: true });
  }
}

addEventListener("hashchange", show);
setInterval(() => page?.tick?.(), 1000);
show();
