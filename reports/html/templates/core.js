// Helpers shared by all views. No text of the run is ever parsed as HTML: it becomes text nodes only.
const $ = (selector, root = document) => root.querySelector(selector);
const $$ = (selector, root = document) => [...root.querySelectorAll(selector)];

const append = (node, children) => {
  for (const child of children.flat(3)) if (child !== null && child !== undefined && child !== false && child !== "") node.append(child);
  return node;
};

/** Make an element: h("td.num", {title: "…", onclick: f}, child, "text", …). */
function h(tag, options, ...children) {
  const [name, ...classes] = tag.split(".");
  const node = document.createElement(name);
  if (classes.length) node.className = classes.join(" ");
  for (const [key, value] of Object.entries(options || {})) {
    if (value === null || value === undefined || value === false) continue;
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else node.setAttribute(key, value === true ? "" : value);
  }
  return append(node, children);
}

/** Make an SVG element. */
function s(tag, options, ...children) {
  const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [key, value] of Object.entries(options || {})) if (value !== null && value !== undefined) node.setAttribute(key, value);
  return append(node, children);
}

const icon = (name) => s("svg", { class: "icon", "aria-hidden": "true" }, s("use", { href: "#i-" + name }));
const verdictTag = (verdict) => h("span.verdict.v-" + verdict, null, icon(verdict), verdict);
const readJson = (id) => JSON.parse($("#" + id).textContent);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

/** Seconds with 0.1 ms, the finest step that matters between two bus cycles. */
const seconds = (t) => (t === null ? "–" : t.toFixed(4) + " s");

/** A time from the first fault on, in the unit that suits its size. */
function relative(t, zero) {
  const d = t - zero;
  const size = Math.abs(d);
  const sign = d < -5e-8 ? "−" : "+";
  if (size >= 1) return sign + size.toFixed(3) + " s";
  return sign + (size * 1000).toFixed(size < 0.01 ? 2 : 1) + " ms";
}

/** A number with the digits that its place on the screen deserves. */
function plainNumber(value) {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e7 || size < 1e-4)) return value.toExponential(3);
  return value.toFixed(size >= 10000 ? 0 : size >= 100 ? 1 : size >= 10 ? 2 : 3);
}

/** A number for a label: without zeros that say nothing. */
const tidy = (value) => plainNumber(value).replace(/(\.\d*?)0+(e|$)/, "$1$2").replace(/\.(e|$)/, "$1");

const DIGITS = new Map([..."ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"].map((c, i) => [c.charCodeAt(0), i]));

/** Samples of reports/html/numbers.py. */
function decodeNumbers(plain) {
  const size = plain.n;
  const values = new Float64Array(size);
  if ("c" in plain) return values.fill(plain.c);
  if ("f" in plain) {
    const bytes = Uint8Array.from(atob(plain.f), (c) => c.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    for (let i = 0; i < size; i++) values[i] = view.getFloat32(4 * i, true) + plain.a;
    return values;
  }
  const text = plain.d;
  const power = Number("1e" + Math.abs(plain.q)); // exact, unlike Math.pow
  const scale = plain.q < 0 ? (v) => v / power : (v) => v * power;
  let at = 0;
  let whole = plain.b[0];
  let slope = plain.o === 2 ? plain.b[1] : 0;
  const next = () => {
    let number = 0;
    let place = 1;
    for (;;) {
      const digit = DIGITS.get(text.charCodeAt(at++));
      number += (digit & 31) * place; // products, not shifts: encoder counts pass 32 bits
      if (digit < 32) break;
      place *= 32;
    }
    const half = Math.floor(number / 2);
    return number % 2 ? -half : half;
  };
  values[0] = scale(whole);
  for (let i = 1; i < size; i++) {
    if (plain.o === 2) {
      if (i > 1) slope += next();
    } else slope = next();
    whole += slope;
    values[i] = scale(whole);
  }
  return values;
}

/** Index of the last element that is not above t; -1 before the first. */
function indexAt(times, t) {
  let low = 0;
  let high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= t) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

async function copyText(text, button) {
  let done = false;
  try {
    await navigator.clipboard.writeText(text);
    done = true;
  } catch {
    const area = h("textarea", { readonly: true });
    area.value = text;
    document.body.append(area);
    area.select();
    done = document.execCommand("copy");
    area.remove();
  }
  const label = $("span", button);
  const before = label.textContent;
  label.textContent = done ? "copied" : "select and copy by hand";
  setTimeout(() => { label.textContent = before; }, 1500);
}

const copyButton = (text, what) =>
  h("button.copy", { type: "button", "aria-label": "Copy " + what, onclick: (event) => copyText(text, event.currentTarget) }, icon("copy"), h("span", null, "copy"));

// The state of the page lives in the address: #/view/argument?key=value
const readHash = () => {
  const [path, query = ""] = location.hash.replace(/^#\/?/, "").split("?");
  const [view, ...rest] = path.split("/");
  let argument = rest.join("/");
  try {
    argument = decodeURIComponent(argument);
  } catch { /* not ours: no case will match */ }
  return { view: view || "cases", argument, query: new URLSearchParams(query) };
};

const makeHash = (view, argument, query) => {
  const text = new URLSearchParams([...query].filter(([, value]) => value !== "")).toString();
  return "#/" + view + (argument ? "/" + encodeURIComponent(argument).replaceAll("%2F", "/") : "") + (text ? "?" + text : "");
};

/** Change the query of the present view without a new entry in the history. */
function rewriteQuery(change) {
  const { view, argument, query } = readHash();
  for (const [key, value] of Object.entries(change)) {
    if (value === null || value === "") query.delete(key);
    else query.set(key, value);
  }
  const hash = makeHash(view, argument, query);
  if (hash !== location.hash) history.replaceState(null, "", hash);
}

const INDEX = readJson("data-index");
for (const entry of INDEX) {
  for (const name of ["t", "h", "g", "q", "c"]) entry[name] ??= "";
  for (const name of ["tags", "f", "fl", "al", "m"]) entry[name] ??= [];
  entry.text = [entry.id, entry.t, entry.h, entry.q].join(" ").toLowerCase();
}
const PLACE = new Map(INDEX.map((entry, i) => [entry.id, i]));
const caseLink = (identifier) => makeHash("case", identifier, []);

// Cases of a large run are scripts next to the page: a page of a file system may fetch nothing, but add script elements.
const { folder: FOLDER, key: KEY } = document.documentElement.dataset;
const arriving = new Map(); // place -> what takes its case

window.hilData = (key, place, value) => {
  if (key === KEY) arriving.get(place)?.(value);
};

/** Load a script next to the page; the promise fails when it is not there. */
const loadScript = (name) => new Promise((done, fail) => {
  const script = h("script", { src: `${FOLDER}/${name}`, onload: () => { script.remove(); done(); }, onerror: () => { script.remove(); fail(new Error(`${FOLDER}/${name} is missing`)); } });
  document.head.append(script);
});

/** Unpack JSON that was deflated and written in base 64. */
async function unpacked(text) {
  if (!window.DecompressionStream) throw new Error("this browser cannot unpack the data: it needs Chromium 80, Firefox 113, Safari 16.4 or later; junit.xml, summary.json and cases.csv next to the page can be read with anything");
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).json();
}
const readPacked = (id) => unpacked($("#" + id).textContent);

/** The data of a case, from the page or from its file next to it. */
async function caseData(place) {
  if (!FOLDER) return readPacked("data-case-" + place);
  let found = null;
  arriving.set(place, (text) => { found = text; });
  try {
    await loadScript(`${place}.js`);
  } finally {
    arriving.delete(place);
  }
  if (!found) throw new Error(`${FOLDER}/${place}.js belongs to another report`);
  return unpacked(found);
}
