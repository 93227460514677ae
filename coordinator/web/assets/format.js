// Figures as people read them. What the coordinator leaves out is 0, "" or [] (protobuf's JSON).

export const num = (value) => Number(value ?? 0);
export const list = (value) => value ?? [];

export function plural(count, one, many = one + "s") {
  return `${count.toLocaleString("en")} ${count === 1 ? one : many}`;
}

export function duration(seconds) {
  if (seconds < 1) return `${seconds.toFixed(1)} s`;
  if (seconds < 100) return `${Math.round(seconds)} s`;
  const minutes = Math.round(seconds / 60);
  if (minutes < 100) return `${minutes} min`;
  const hours = seconds / 3600;
  if (hours < 48) return `${Math.floor(hours)} h ${Math.round((hours % 1) * 60)} min`;
  return `${Math.round(hours / 24)} days`;
}

export function ago(atMs, nowMs) {
  if (!atMs) return "never";
  const seconds = Math.max(0, (nowMs - atMs) / 1000);
  return seconds < 2 ? "just now" : `${duration(seconds)} ago`;
}

export function when(atMs) {
  if (!atMs) return "–";
  const date = new Date(atMs);
  const day = date.toLocaleDateString("en-GB", { day: "numeric", month: "short", year: "numeric" });
  const time = date.toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit" });
  return `${day}, ${time}`;
}

export function bytes(count) {
  const units = ["B", "KiB", "MiB", "GiB", "TiB"];
  let at = 0;
  while (count >= 1024 && at < units.length - 1) {
    count /= 1024;
    ++at;
  }
  return `${count < 10 && at > 0 ? count.toFixed(1) : Math.round(count)} ${units[at]}`;
}

export function rate(perSecond) {
  if (perSecond >= 1) return `${perSecond.toFixed(perSecond < 10 ? 1 : 0)} shards/s`;
  return `${(perSecond * 60).toFixed(perSecond * 60 < 10 ? 1 : 0)} shards/min`;
}

export function percent(share) {
  const value = 100 * share;
  return `${value >= 100 || value === 0 ? Math.round(value) : Math.min(99, Math.floor(value))} %`;
}

export function figure(value) {
  const size = Math.abs(value);
  if (value !== 0 && (size < 0.001 || size >= 1e6)) return value.toExponential(2);
  return Number(value.toPrecision(3)).toLocaleString("en", { maximumSignificantDigits: 3 });
}

// JOB_STATE_RUNNING, "JOB_STATE" is running.
export function word(value, prefix) {
  return (value ?? `${prefix}_UNSPECIFIED`).slice(prefix.length + 1).toLowerCase().replaceAll("_", " ");
}

// Of bytes in base64, the first digits.
export function hex(base64, digits = 12) {
  const text = [...atob(base64 ?? "")].map((c) => c.charCodeAt(0).toString(16).padStart(2, "0")).join("");
  return text.slice(0, digits);
}

// "runs 2 shards" as a sentence of its own.
export function sentence(text) {
  return text ? text[0].toUpperCase() + text.slice(1) + (/[.!?…]$/.test(text) ? "" : ".") : "";
}

// Whether a user is known: without certificates jobs are nobody's.
export const named = (user) => Boolean(user) && user !== "nobody";
