// Elements, numbers as text, and a place for messages.

/** Make an element: `h("button.primary", {onclick, disabled: true}, "text", child)`. */
export function h(description, properties = {}, ...children) {
  const [tag, ...classes] = description.split(".");
  const element = document.createElement(tag);
  if (classes.length) element.className = classes.join(" ");
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && name !== "list" && name !== "form") element[name] = value;
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false) element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((one) => one !== null && one !== undefined));
  return element;
}

const SVG = "http://www.w3.org/2000/svg";

/** Make an SVG element. */
export function s(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** Make SVG elements of nested lists, `[tag, attributes, children]`; a child may be a text. */
export function drawn([tag, attributes, children]) {
  return s(tag, attributes, ...children.map((one) => (typeof one === "string" ? one : drawn(one))));
}

/** Set the text of an element, if it has changed: what a person has selected stays selected. */
export function text(element, content) {
  if (element.textContent !== content) element.textContent = content;
}

/** Show or hide an element. */
export function show(element, visible) {
  if (element.hidden === visible) element.hidden = !visible;
}

/** Set or remove a class. */
export function mark(element, name, on) {
  element.classList.toggle(name, Boolean(on));
}

const MINUS = "\u2212";

/** A number with so many decimals; a dash for none. No minus in front of a rounded zero. */
export function number(value, decimals = 3) {
  if (value === null || value === undefined || Number.isNaN(value)) return "\u2013";
  let shown = value.toFixed(decimals);
  if (Number(shown) === 0) shown = (0).toFixed(decimals);
  return shown.replace("-", MINUS);
}

/** A number as short as its size allows, for scales and cursors. */
export function short(value) {
  if (value === null || value === undefined || Number.isNaN(value)) return "\u2013";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e7 || size < 1e-4)) return value.toExponential(2).replace("-", MINUS);
  const decimals = size >= 1000 ? 1 : size >= 10 ? 2 : size >= 1 ? 3 : 4;
  return number(value, decimals);
}

/** A unit as it is printed: mm/s² for mm/s2. */
export function unit(name) {
  return (name || "").replace(/2$/, "\u00b2").replace(/3$/, "\u00b3");
}

let toasts;

/** Show a sentence for some seconds; screen readers say it. */
export function toast(message, kind = "info") {
  if (!toasts) {
    toasts = h("div.toasts", { role: "status", "aria-live": "polite" });
    document.body.append(toasts);
  }
  const line = h(`div.toast.${kind}`, {}, message);
  const close = h("button.plain", { type: "button", ariaLabel: "Close message", onclick: () => line.remove() }, "\u00d7");
  line.append(close);
  toasts.append(line);
  while (toasts.children.length > 4) toasts.firstChild.remove();
  setTimeout(() => line.remove(), kind === "error" ? 12000 : 5000);
}

/** A labelled input. */
export function field(label, input, after = "") {
  return h("label.field", {}, h("span", {}, label), h("span.input", {}, input, after ? h("span.unit", {}, after) : null));
}
