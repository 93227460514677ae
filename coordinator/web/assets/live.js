// What the coordinator says as it happens: one stream of events for the page that is shown. It is
// closed while nobody looks at the page, because a browser has few connections for all its tabs.

const RETRY_MS = 3000;
const NAMES = ["jobs", "workers", "fabrics", "job", "explain"];

export class Live {
  #source = null;
  #job = "";
  #retry = 0;
  #offsetMs = 0;
  #values = new Map();
  #onEvent;
  #onConnection;

  constructor(onEvent, onConnection) {
    this.#onEvent = onEvent;
    this.#onConnection = onConnection;
    document.addEventListener("visibilitychange", () => (document.hidden ? this.#close() : this.#open()));
  }

  // The coordinator's clock.
  now() {
    return Date.now() + this.#offsetMs;
  }

  // What was said last, to be shown at once.
  last(name) {
    return this.#values.get(name);
  }

  // From now on also of this job; "" is none.
  watch(job) {
    if (this.#source && job === this.#job) return;
    if (job !== this.#job) {
      this.#values.delete("job");
      this.#values.delete("explain");
    }
    this.#job = job;
    this.#open();
  }

  #close() {
    clearTimeout(this.#retry);
    this.#source?.close();
    this.#source = null;
  }

  #open() {
    this.#close();
    const query = this.#job ? `?job=${encodeURIComponent(this.#job)}` : "";
    const source = new EventSource(`api/events${query}`);
    this.#source = source;
    source.onopen = () => this.#onConnection("live", "Live");
    source.onerror = () => {
      if (this.#source !== source) return;
      this.#onConnection("away", "The coordinator does not answer; trying again");
      if (source.readyState === EventSource.CLOSED) this.#openLater();
    };
    for (const name of NAMES) {
      source.addEventListener(name, (event) => this.#take(name, JSON.parse(event.data)));
    }
    source.addEventListener("over", (event) => {
      this.#close();
      this.#onConnection("away", JSON.parse(event.data).value.error.message);
      this.#openLater();
    });
  }

  #openLater() {
    this.#close();
    this.#retry = setTimeout(() => this.#open(), RETRY_MS);
  }

  #take(name, { now_ms, value }) {
    this.#offsetMs = now_ms - Date.now();
    this.#values.set(name, value);
    this.#onEvent(name, value);
  }
}

// GET, as JSON. Throws an Error in the coordinator's words.
export async function ask(path, signal) {
  const answer = await fetch(`api/${path}`, { signal });
  if (!answer.ok) throw await problemOf(answer);
  return answer.json();
}

export async function problemOf(answer) {
  let problem = { code: "unavailable", message: `The coordinator answers ${answer.status}.` };
  try {
    problem = (await answer.json()).error;
  } catch {
    // It was not the coordinator that answered.
  }
  return Object.assign(new Error(problem.message), { code: problem.code, status: answer.status });
}
