// What lies over the curves: faults, alarms and checks as rows of events and as marks in the panels, states as lanes.
const pen = document.createElement("canvas").getContext("2d");
pen.font = `10.5px ${FONT}`;
const widths = new Map();

/** Width of a label, px, with a little room around it. */
function textWidth(text) {
  if (!widths.has(text)) {
    if (widths.size > 5000) widths.clear();
    widths.set(text, pen.measureText(text).width + 6);
  }
  return widths.get(text);
}

/** The beginning of a text that fits, or nothing where not even some letters do. */
function fitText(text, width) {
  if (textWidth(text) <= width) return text;
  if (width < 26) return "";
  let size = Math.max(1, Math.floor((text.length * (width - 10)) / textWidth(text)));
  while (size > 1 && textWidth(text.slice(0, size) + "…") > width) size--;
  return text.slice(0, size).trimEnd() + "…";
}

/** Round times for the axis, with their labels; as many as have room. */
function timeTicks([from, to], width) {
  const rough = ((to - from) * 64) / Math.max(width, 64);
  const size = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((factor) => factor * size).find((one) => one >= rough * 0.999);
  const digits = clamp(-Math.floor(Math.log10(step) + 1e-9), 0, 7);
  const ticks = [];
  for (let i = Math.ceil(from / step - 1e-9); i * step <= to + 1e-12; i++) ticks.push([i * step, `${(i * step).toFixed(digits)} s`]);
  return ticks;
}

/** What lies under the curves: the grid of the time axis and its labels. */
function drawGround(svg, plot) {
  const { width, height, left, plotWidth, bottom } = plot.geometry;
  const [grid, dim] = [css("--grid"), css("--dim")];
  const out = [];
  let free = 0;
  for (const [t, words] of timeTicks(plot.range, plotWidth)) {
    const x = left + ((t - plot.range[0]) / (plot.range[1] - plot.range[0])) * plotWidth;
    out.push(s("line", { x1: x, x2: x, y1: 0, y2: bottom, stroke: grid }));
    const wide = textWidth(words);
    const from = Math.min(x - wide / 2, width - wide);
    if (from < free) continue;
    free = from + wide + 6;
    out.push(s("text", { class: "tick", x: from + 3, y: bottom + 13, fill: dim, "data-from": from, "data-to": from + wide }, words));
  }
  svg.setAttribute("width", width);
  svg.setAttribute("height", height);
  svg.replaceChildren(...out);
}

/** Rows of events of a case; intervals that overlap in time go to different rows. */
function eventRows(data, plotWidth) {
  const rows = [];
  const perPixel = (data.end - data.start) / plotWidth || 1;
  const claim = (item) => item.to + (textWidth(item.text) + 14) * perPixel; // the label needs its place too
  const pack = (label, items, most) => {
    const mine = [];
    for (const item of items) {
      const free = mine.find((row) => row.items.every((other) => item.from > claim(other) || claim(item) < other.from));
      if (free) free.items.push(item);
      else if (mine.length < most) mine.push({ label: mine.length ? "" : label, items: [item] });
      else mine[most - 1].items.push(item);
    }
    rows.push(...mine);
  };
  const end = (t) => (t === null ? data.end : t);
  pack("Faults", data.faults.filter((fault) => fault[3] !== null).map((fault) => ({ kind: "fault", from: fault[3], to: end(fault[4]), text: `${fault[0]} → ${fault[1]}` })), 3);
  pack("Alarms", data.alarms.map((alarm) => ({ kind: "alarm", from: alarm[0], to: end(alarm[1]), text: `${alarm[3]} ${alarm[6] || alarm[5]}${alarm[6] ? ` · ${alarm[5]}` : ""}` })), 3);
  const timed = data.checks.filter((check) => check.t !== null || check.since !== null);
  const urgent = [...timed.filter((check) => check.v !== "passed"), ...timed.filter((check) => check.v === "passed")];
  pack("Checks", urgent.map((check) => {
    const since = check.since ?? check.t;
    const to = check.t ?? since + (check.scale && check.high !== null ? check.high * check.scale : 0);
    const measured = check.value === null ? check.observed : check.unit === "s" && Math.abs(check.value) < 1 ? `${tidy(check.value * 1000)} ms` : `${tidy(check.value)} ${check.unit}`;
    const text = check.v === "failed" ? `${check.name}: ${measured}${check.limits ? ` (${check.limits})` : ""}` : check.name;
    return { kind: "check", check, from: Math.min(since, to), to: Math.max(since, to), text };
  }), 5);
  return rows;
}

/** Times covered by at least one of the items: shades do not add up. */
function union(items) {
  const merged = [];
  for (const { from, to } of [...items].sort((a, b) => a.from - b.from)) {
    if (merged.length && from <= merged.at(-1)[1]) merged.at(-1)[1] = Math.max(merged.at(-1)[1], to);
    else merged.push([from, to]);
  }
  return merged;
}

/** Class of a state by its name: the eye finds faults and stops before it reads. */
function laneColour(lane, value, text) {
  if (lane.kind === "bit") return value ? "--l-ready" : null;
  if (lane.kind === "code") return value ? (/alarm|error|fault/i.test(lane.name) ? "--l-bad" : "--l-n") : null;
  if (lane.kind === "word") return "--l-off";
  const name = text.toLowerCase().replaceAll("_", " ");
  if (/fault|error|alarm|abort|lost/.test(name)) return "--l-bad";
  if (/stop|halt|brak|disabling|tracking|coast/.test(name)) return "--l-stop";
  if (/motion|moving|operation enabled|operational|running|accelerat|decelerat|constant|active|busy|homing/.test(name)) return "--l-run";
  if (/not |disab|off|inhibit|idle|init|reset|restart|unknown|none/.test(name)) return "--l-off";
  if (/ready|stand ?still|enabl|switched on|hold|position|done|on$/.test(name)) return "--l-ready";
  return "--l-n";
}

function laneText(lane, value) {
  if (value === null) return "";
  if (lane.kind === "state") return lane.texts[value] ?? String(value);
  if (lane.kind === "bit") return value ? "1" : "0";
  if (lane.kind === "word") return (value < 0 ? value >>> 0 : value).toString(16).toUpperCase().padStart(4, "0") + "h";
  if (lane.kind === "code" && /error_code|emcy/.test(lane.name) && value) return value.toString(16).toUpperCase().padStart(4, "0") + "h";
  return value ? String(value) : "";
}

function drawOverlay(svg, plot) {
  const { width, height, left, narrow, plotWidth, bottom, rows } = plot.geometry;
  const [from, to] = plot.range;
  const right = left + plotWidth;
  const x = (t) => left + ((t - from) / (to - from)) * plotWidth;
  const inside = (t) => clamp(x(t), left, right);
  const colour = Object.fromEntries(["--fault", "--fault-fill", "--alarm", "--alarm-fill", "--limit", "--dim", "--ink", "--line", "--line2", "--ok", "--bad", "--l-ink", "--bar-ok", "--bar-bad", "--card", "--l-off", "--l-ready", "--l-run", "--l-stop", "--l-bad", "--l-n"].map((name) => [name, css(name)]));
  const out = [
    s("defs", null,
      s("clipPath", { id: "plot-clip" }, s("rect", { x: left, y: 0, width: plotWidth, height: bottom })),
      s("pattern", { id: "hatch", width: 6, height: 6, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" }, s("rect", { width: 2, height: 6, fill: colour["--fault"], opacity: 0.55 })),
      s("pattern", { id: "hatch-bad", width: 6, height: 6, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" }, s("rect", { width: 1.4, height: 6, fill: colour["--bar-bad"], opacity: 0.6 }))),
  ];
  const label = (text, px, py, fill, more) => s("text", { x: px, y: py, fill, ...more }, text);
  const marks = s("g", { "clip-path": "url(#plot-clip)" });
  out.push(marks);

  // marks in the panels
  const firstPanel = plot.panels.length ? plot.panels[0].top - 2 : bottom;
  const spans = plot.panels.map((panel) => [panel.top, panel.bottom - panel.top]);
  for (const kind of ["fault", "alarm"]) {
    for (const [start, end] of union(rows.flatMap((row) => row.items.filter((item) => item.kind === kind)))) {
      const [a, b] = [inside(start), inside(end)];
      for (const [y, tall] of spans) if (b > a) marks.append(s("rect", { x: a, y, width: b - a, height: tall, fill: colour[`--${kind}-fill`] }));
    }
  }
  for (const row of rows) {
    for (const item of row.items) {
      if (item.kind === "check" || item.from < from || item.from > to) continue;
      marks.append(s("line", { x1: x(item.from), x2: x(item.from), y1: row.top + 2, y2: bottom, stroke: colour["--" + item.kind], "stroke-width": 1.3, "stroke-dasharray": item.kind === "fault" ? "6 3" : null }));
    }
  }

  // rows of events
  for (const row of rows) {
    out.push(label(row.label, left - 8, row.top + 13, colour["--dim"], { "text-anchor": "end" }));
    row.items.forEach((item, i) => {
      const next = Math.min(right, ...row.items.filter((other, k) => k !== i && x(other.from) > x(item.from)).map((other) => x(other.from)));
      if (item.to < from || item.from > to) return;
      if (item.kind === "check") drawCheck(marks, item, row.top, { x, inside, left, right, next, colour });
      else drawBand(marks, item, row.top, { inside, next, colour });
    });
  }
  if (rows.length) out.push(s("line", { x1: 0, x2: width, y1: rows.at(-1).top + PLOT.event + 1.5, y2: rows.at(-1).top + PLOT.event + 1.5, stroke: colour["--line2"] }));

  for (const lane of plot.lanes) {
    // In a narrow window the name stands above the band, where it has room.
    if (narrow) out.push(label(fitText(lane.name, width - 12), 6, lane.top - 1, colour["--dim"]));
    else out.push(label(fitText(lane.name, left - 8), left - 8, lane.top + 13, colour["--dim"], { "text-anchor": "end" }));
    drawLane(marks, lane, plot.range, x, inside, colour);
    if (lane.ghost) drawGhost(marks, lane, plot, x, inside, colour);
  }

  // limits of measured levels
  plot.panels.forEach((panel, k) => {
    const [low, high] = plot.yRanges[k];
    const taken = []; // places of labels: two checks may have limits close together
    const y = (value) => panel.bottom - ((value - low) / (high - low)) * (panel.bottom - panel.top);
    for (const { value, side, check } of panel.limits) {
      const twin = panel.limits.find((other) => other.check === check && other.side !== side);
      const close = twin && Math.abs(y(value) - y(twin.value)) < 24;
      const py = y(value);
      if (py < panel.top - 1 || py > panel.bottom + 1) continue;
      const [a, b] = [inside(check.since ?? plot.all[0]), inside(check.v === "passed" || check.t === null ? (check.t ?? plot.all[1]) : plot.all[1])];
      marks.append(s("line", { x1: a, x2: b, y1: py, y2: py, stroke: colour["--limit"], "stroke-width": 1.4, "stroke-dasharray": "2 2" }));
      if (close && side === "low") continue;
      const words = close ? check.limits : `${side === "low" ? "≥" : "≤"} ${tidy(value)} ${check.unit}`;
      const roomy = b - a > textWidth(words) + 20;
      const px = roomy ? b - 1 - textWidth(words) : Math.min(a + 4, right - textWidth(words));
      const sides = side === "low" ? [py + 12, py - 5] : [py - 5, py + 12];
      const place = sides.map((one) => clamp(one, panel.top + 9, panel.bottom - 2))
        .find((one) => taken.every(([tx, ty, wide]) => px > tx + wide || px + textWidth(words) < tx || Math.abs(ty - one) > 11));
      if (place === undefined) continue;
      taken.push([px, place, textWidth(words)]);
      marks.append(label(words, px, place, colour["--limit"], { "font-weight": 600, "paint-order": "stroke", stroke: colour["--card"], "stroke-width": 3 }));
    }
    for (const check of plot.data.checks) {
      if (check.v !== "failed" || check.t === null || check.t < from || check.t > to || !panel.traces.some((trace) => trace.name === check.signal) || check.value === null) continue;
      const [px, py] = [x(check.t), clamp(y(check.value), panel.top, panel.bottom)];
      marks.append(s("circle", { cx: px, cy: py, r: 5, fill: "none", stroke: colour["--bar-bad"], "stroke-width": 2 }));
    }
    out.push(s("line", { x1: left, x2: right, y1: panel.bottom + 0.5, y2: panel.bottom + 0.5, stroke: colour["--line"] }));
  });
  out.push(s("line", { x1: left - 0.5, x2: left - 0.5, y1: firstPanel, y2: bottom, stroke: colour["--line"] }));
  svg.setAttribute("width", width);
  svg.setAttribute("height", height);
  svg.replaceChildren(...out);
}

function drawBand(group, item, top, { inside, next, colour }) {
  const [a, b] = [inside(item.from), inside(item.to)];
  const wide = Math.max(3, b - a);
  const main = colour["--" + item.kind];
  group.append(s("rect", { x: a, y: top + 2, width: wide, height: 14, rx: 2, fill: item.kind === "fault" ? "url(#hatch)" : colour["--l-bad"], stroke: main, "stroke-width": 1 }));
  const within = textWidth(item.text) <= wide - 8;
  const space = within ? wide - 8 : next - a - wide - 8;
  const text = fitText(item.text, item.kind === "alarm" && !within ? Math.max(space, wide - 8) : space);
  if (!text) return;
  const inBar = within || (item.kind === "alarm" && space < wide - 8);
  const at = inBar ? a + 5 : a + wide + 5;
  if (inBar && item.kind === "fault") group.append(s("rect", { x: at - 2, y: top + 4, width: textWidth(text) - 2, height: 10, fill: colour["--card"], opacity: 0.85 }));
  group.append(s("text", { x: at, y: top + 13, fill: inBar && item.kind === "alarm" ? colour["--l-ink"] : main, "font-weight": 600 }, text));
}

function drawCheck(group, item, top, { x, inside, left, right, next, colour }) {
  const { check } = item;
  const failed = check.v === "failed";
  const main = failed ? colour["--bar-bad"] : check.v === "passed" ? colour["--bar-ok"] : colour["--dim"];
  const middle = top + 9;
  if (check.since !== null) {
    if (check.scale && (check.low !== null || check.high !== null)) {
      // a time was measured: the allowed part of the time axis as a box, the measured time as a line over it
      const a = inside(check.since + Math.max(0, check.low ?? 0) * check.scale);
      const b = check.high === null ? right : inside(check.since + check.high * check.scale);
      group.append(s("rect", { x: a, y: top + 3, width: Math.max(1, b - a), height: 12, fill: colour["--bar-ok"], opacity: 0.22 }));
      if (check.high !== null) group.append(s("line", { x1: b, x2: b, y1: top + 1, y2: top + 17, stroke: colour["--bar-ok"], "stroke-width": 2 }));
    }
    const [a, b] = [inside(item.from), inside(item.to)];
    group.append(s("line", { x1: a, x2: b, y1: middle, y2: middle, stroke: main, "stroke-width": 2 }), s("line", { x1: a, x2: a, y1: top + 4, y2: top + 14, stroke: main, "stroke-width": 1.5 }));
  }
  if (check.t !== null) {
    const px = x(check.t);
    group.append(failed
      ? s("path", { d: `M${px - 4} ${middle - 4}l8 8M${px + 4} ${middle - 4}l-8 8`, stroke: main, "stroke-width": 2.4 })
      : s("path", { d: `M${px} ${middle - 5}l5 5-5 5-5-5z`, fill: main }));
  }
  const end = Math.max(inside(item.to), check.high !== null && check.scale && check.since !== null ? inside(check.since + check.high * check.scale) : left) + 8;
  const text = fitText(item.text, Math.min(next, right) - end);
  if (text) group.append(s("text", { x: end, y: top + 13, fill: failed ? colour["--bad"] : colour["--dim"], "font-weight": failed ? 600 : 400 }, text));
}

function drawLane(group, lane, range, x, inside, colour) {
  const first = Math.max(0, indexAt(lane.s, range[0]));
  let skipUntil = -1;
  for (let i = first; i < lane.s.length && lane.s[i] <= range[1]; i++) {
    const value = lane.y[i];
    const stop = i + 1 < lane.s.length ? lane.s[i + 1] : lane.end;
    if (value === null || stop < range[0]) continue;
    const [a, b] = [inside(lane.s[i]), inside(stop)];
    if (b - a < 0.6) { // narrower than a pixel: one tick for all that fall on it
      if (a >= skipUntil) {
        group.append(s("rect", { x: a, y: lane.top + 2, width: 1, height: PLOT.lane - 4, fill: colour["--dim"] }));
        skipUntil = a + 1;
      }
      continue;
    }
    const text = laneText(lane, value);
    const name = laneColour(lane, value, text);
    const middle = lane.top + 13;
    if (!name) group.append(s("line", { x1: a, x2: b, y1: lane.top + PLOT.lane - 3.5, y2: lane.top + PLOT.lane - 3.5, stroke: colour["--line"] }));
    else {
      group.append(s("rect", { x: a, y: lane.top + 2, width: b - a, height: PLOT.lane - 4, fill: colour[name], stroke: colour["--card"], "stroke-width": 0.8 }));
      if (name === "--l-bad") group.append(s("rect", { x: a, y: lane.top + 2, width: b - a, height: PLOT.lane - 4, fill: "url(#hatch-bad)", opacity: 0.35 }));
      const shown = fitText(text, b - a - 4);
      if (shown) group.append(s("text", { class: "band", "data-lane": lane.name, "data-from": a, "data-to": a + 4 + textWidth(shown), x: a + 4, y: middle, fill: colour["--l-ink"] }, shown));
    }
  }
}

/** The states of the case that is compared, as a thin band below those of this case. */
function drawGhost(group, lane, plot, x, inside, colour) {
  const { ghost } = lane;
  const shift = plot.other.shift;
  for (let i = 0; i < ghost.s.length; i++) {
    const [a, b] = [inside(ghost.s[i] + shift), inside((i + 1 < ghost.s.length ? ghost.s[i + 1] : ghost.end) + shift)];
    const name = ghost.y[i] === null ? null : laneColour(ghost, ghost.y[i], laneText(ghost, ghost.y[i]));
    if (name && b - a >= 0.6) group.append(s("rect", { x: a, y: lane.top + PLOT.lane - 1, width: b - a, height: PLOT.ghost - 1, fill: colour[name], stroke: colour["--line"], "stroke-width": 0.5 }));
  }
}

/** Name at the cursor the states whose bands are too narrow for their text; texts of other bands make room. */
function drawPills(svg, overlay, plot, t, toX) {
  svg.setAttribute("width", plot.geometry.width);
  svg.setAttribute("height", plot.geometry.height);
  const out = [];
  const covered = new Map(); // lane -> from, to
  if (t !== null && t >= plot.range[0] && t <= plot.range[1]) {
    for (const lane of plot.lanes) {
      const i = indexAt(lane.s, t + 1e-9);
      if (i < 0 || lane.y[i] === null) continue;
      const text = laneText(lane, lane.y[i]);
      const stop = i + 1 < lane.s.length ? lane.s[i + 1] : lane.end;
      const room = toX(Math.min(stop, plot.range[1])) - toX(Math.max(lane.s[i], plot.range[0]));
      if (!text || lane.kind === "bit" || textWidth(text) <= room - 4) continue;
      const wide = textWidth(text) + 4;
      const at = toX(t) + wide + 6 > plot.geometry.width ? toX(t) - wide - 4 : toX(t) + 4;
      covered.set(lane.name, [at, at + wide]);
      out.push(s("rect", { x: at, y: lane.top + 1.5, width: wide, height: PLOT.lane - 3, rx: 3, fill: css("--ink") }), s("text", { x: at + 5, y: lane.top + 13, fill: css("--bg") }, text));
    }
  }
  for (const band of overlay.querySelectorAll(".band")) {
    const place = covered.get(band.dataset.lane);
    band.style.visibility = place && Number(band.dataset.to) > place[0] && Number(band.dataset.from) < place[1] ? "hidden" : "";
  }
  svg.replaceChildren(...out);
}

/** Give the reader a file. */
function offer(blob, name) {
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

const fileName = (data, end) => data.id.replace(/[^A-Za-z0-9._-]+/g, "_") + end;

/** Save what is visible as a PNG: the canvases of the curves between the two layers of drawings, and the names of the curves. */
async function savePicture(ground, canvases, overlay, plot) {
  const { width, height } = plot.geometry;
  const canvas = h("canvas", { width: width * 2, height: height * 2 });
  const context = canvas.getContext("2d");
  context.scale(2, 2);
  context.fillStyle = css("--card");
  context.fillRect(0, 0, width, height);
  const paint = async (nodes) => {
    const picture = s("svg", { xmlns: "http://www.w3.org/2000/svg", width, height, "font-family": "sans-serif", "font-size": 10.5 }, nodes);
    const image = new Image();
    image.src = "data:image/svg+xml;charset=utf-8," + encodeURIComponent(new XMLSerializer().serializeToString(picture));
    await image.decode();
    context.drawImage(image, 0, 0, width, height);
  };
  await paint([...ground.childNodes].map((node) => node.cloneNode(true)));
  for (const [curve, top] of canvases) context.drawImage(curve, 0, top, width, (width * curve.height) / curve.width);
  const names = [];
  for (const panel of plot.panels) {
    const colours = traceColours(panel);
    let at = plot.geometry.left + 6;
    const write = (text, fill, weight) => {
      names.push(s("text", { x: at, y: panel.top - 6, fill, "font-weight": weight }, text));
      at += textWidth(text) + 8;
    };
    write(`${panel.title} ${panel.unit && `[${panel.unit}]`}`, css("--ink"), 600);
    panel.traces.forEach((trace, i) => hiddenTraces.has(trace.name) || write((trace.set ? "- - " : "— ") + trace.name, css(colours[i]), 400));
  }
  await paint([...[...overlay.childNodes].map((node) => node.cloneNode(true)), ...names]);
  canvas.toBlob((blob) => offer(blob, fileName(plot.data, ".png")));
}

/** The visible signals in the visible time as a table: a row for each time at which one of them has a sample, texts for states. */
function csvOf(plot) {
  const [from, to] = plot.range;
  const traces = plot.visible();
  const times = new Set(traces.flatMap((trace) => [...trace.x]));
  for (const lane of plot.lanes) lane.s.forEach((t) => times.add(t));
  const rows = [...times].filter((t) => t >= from - 1e-9 && t <= to + 1e-9).sort((a, b) => a - b);
  const units = new Map(plot.panels.flatMap((panel) => panel.traces.map((trace) => [trace, panel.unit])));
  const quoted = (text) => (/[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const head = ["time [s]", ...traces.map((trace) => trace.name + (units.get(trace) ? ` [${units.get(trace)}]` : "")), ...plot.lanes.map((lane) => lane.name)];
  const places = traces.map(() => 0);
  const line = (t) => [
    t.toFixed(7),
    ...traces.map((trace, k) => {
      while (places[k] < trace.x.length && trace.x[places[k]] < t) places[k]++;
      return trace.x[places[k]] === t && Number.isFinite(trace.values[places[k]]) ? String(Number(trace.values[places[k]].toPrecision(9))) : "";
    }),
    ...plot.lanes.map((lane) => {
      const at = indexAt(lane.s, t + 1e-9);
      return at < 0 || t > lane.end + 1e-9 ? "" : laneText(lane, lane.y[at]);
    }),
  ].map(quoted).join(",");
  return [head.map(quoted).join(","), ...rows.map(line)].join("\r\n") + "\r\n";
}

const saveCsv = (plot) => offer(new Blob([csvOf(plot)], { type: "text/csv" }), fileName(plot.data, ".csv"));
