// Elements, made and renewed. Everything that comes from outside becomes text, never markup.

// el("a", {class: "job", href: "#/", on: {click: f}}, "text", child): attributes that are null or
// false are left out, children that are null too.
export function el(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "on") {
      for (const [event, listener] of Object.entries(value)) element.addEventListener(event, listener);
    } else if (value !== null && value !== undefined && value !== false) {
      element.setAttribute(name, value === true ? "" : String(value));
    }
  }
  for (const child of children.flat()) {
    if (child !== null && child !== undefined && child !== false) element.append(child);
  }
  return element;
}

export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setAttribute(element, name, value) {
  if (value === null || value === false) {
    element.removeAttribute(name);
  } else if (element.getAttribute(name) !== String(value)) {
    element.setAttribute(name, String(value));
  }
}

const kept = new WeakMap();

// Makes the children of `parent` those of `items`, in their order. An item that was there before
// keeps its element, and so what is focused or opened in it. `make(item)` gives {element, update}.
export function keyed(parent, items, keyOf, make) {
  const before = kept.get(parent) ?? new Map();
  const now = new Map();
  for (const item of items) {
    const key = keyOf(item);
    const entry = before.get(key) ?? make(item);
    entry.update?.(item);
    now.set(key, entry);
  }
  for (const [key, entry] of before) {
    if (!now.has(key)) {
      entry.leave?.();
      entry.element.remove();
    }
  }
  let at = parent.firstElementChild;
  for (const { element } of now.values()) {
    if (element === at) {
      at = at.nextElementSibling;
    } else {
      parent.insertBefore(element, at);
    }
  }
  kept.set(parent, now);
}

// Puts children in place of what was there, when they are other ones.
export function fill(parent, ...children) {
  parent.replaceChildren(...children.flat().filter((child) => child));
}
