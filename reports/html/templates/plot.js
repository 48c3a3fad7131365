// The plot of a case. uPlot draws the curves of each panel and its value axis; the time axis, the cursor, the heads and everything
// that marks a moment (faults, alarms, checks, states) are drawn around and over them by overlay.js from the same time range.
const PLOT = { right: 14, axis: 26, top: 4, lane: 19, name: 13, ghost: 6, event: 19, gap: 7, above: 6 };
const NARROW = 620;
const [PRINT_WIDTH, PRINT_HEIGHT] = [718, 470]; // the width of an A4 page, and the share of it that the plot may take
const shownChoice = new Map(); // what the reader switched on or off stays so in the next case
const hiddenTraces = new Set();
let fitY = true;
let printing = false;

const wideWindow = () => !printing && matchMedia("(min-width: 1101px)").matches;

const traceColours = (panel) => {
  const acts = ["--s-act", "--s-3", "--s-4", "--s-6", "--s-8"];
  const sets = ["--s-set", "--s-5", "--s-7"];
  let a = 0;
  let b = 0;
  return panel.traces.map((trace) => (trace.set ? sets[b++ % sets.length] : acts[a++ % acts.length]));
};

/** Decode the samples of a case: panels with traces of `x` and `values`, and lanes. */
function decodeCurves(data) {
  const times = data.times.map(decodeNumbers);
  return {
    panels: data.panels.map((panel) => ({
      ...panel, key: `panel ${panel.title} [${panel.unit}] ${panel.traces[0].name.split(".")[0]}`,
      traces: panel.traces.map((trace) => ({ ...trace, x: times[trace.t], values: decodeNumbers(trace.y) })),
    })),
    lanes: data.lanes.map((lane) => ({ ...lane, key: "lane " + lane.name })),
  };
}

/** The last sample of a trace at a time; nothing before the first. */
const valueAt = (trace, t) => {
  const at = indexAt(trace.x, t + 1e-9);
  return at < 0 ? null : trace.values[at];
};

/** Samples as uPlot takes them: one time axis, gaps as null. Where each trace has times of its own they are joined. */
function joined(traces) {
  const columns = traces.map((trace) => [trace.x, trace.values.some(Number.isNaN) ? Array.from(trace.values, (v) => (Number.isNaN(v) ? null : v)) : trace.values]);
  if (columns.every(([x]) => x === columns[0][0])) return [columns[0][0], ...columns.map(([, y]) => y)];
  return uPlot.join(columns);
}

/** A value of an axis with as many digits as its steps have. */
function axisText(value, step) {
  const size = Math.abs(value);
  if (step >= 1e6) return `${value / 1e6} M`;
  if (step >= 1e4) return `${value / 1e3} k`;
  if (size && step < 1e-4) return value.toExponential(1);
  const digits = [0, 1, 2, 3, 4, 5].find((count) => Math.abs(step * 10 ** count - Math.round(step * 10 ** count)) < 1e-6);
  return value.toFixed(digits ?? 6);
}

/** Build the plot of a case into `pane`; returns its remote control. */
function makePlot(data, pane, hooks) {
  const { panels, lanes } = decodeCurves(data);
  const isShown = (item) => shownChoice.get(item.key) ?? item.on;
  const all = [data.start, Math.max(data.end, data.start + 1e-6)];
  const plot = { data, all, range: [...all], panels: [], lanes: [], yRanges: [], a: null, b: null, hover: null, geometry: null, other: null };
  const scroll = h("div.plot-scroll");
  const root = h("div.plot", { tabindex: 0, role: "group", "aria-label": "Plot. Left and right move the cursor, plus and minus zoom, 0 shows the whole case, f goes to the fault." });
  const ground = s("svg", { class: "ground", "aria-hidden": "true" });
  const curves = h("div.curves", { "aria-hidden": "true" });
  const overlay = s("svg", { class: "overlay", "aria-hidden": "true" });
  const pills = s("svg", { class: "overlay", "aria-hidden": "true" });
  const marks = { a: h("div.cursor.locked", null, h("i")), b: h("div.cursor.locked", null, h("i")), hover: h("div.cursor", null, h("i")) };
  const selection = h("div.selection", { hidden: true });
  root.append(ground, curves, overlay, pills, selection, marks.hover, marks.a, marks.b);
  root.plot = plot;
  scroll.append(root);
  const readout = h("span.readout", { role: "status" });
  let drawn = []; // a uPlot for each panel
  let heads = [];

  /** The trace of the same name in the case that is compared, moved in time. */
  const ghostOf = (trace) => {
    const other = plot.other?.curves.panels.flatMap((panel) => panel.traces).find((one) => one.name === trace.name);
    return other && { ...other, x: plot.other.shift ? other.x.map((t) => t + plot.other.shift) : other.x };
  };

  const fit = (range) => plot.panels.map((panel) => {
    let low = Infinity;
    let high = -Infinity;
    for (const trace of [...panel.traces, ...panel.ghosts.filter(Boolean)]) {
      if (hiddenTraces.has(trace.name)) continue;
      const first = fitY ? Math.max(0, indexAt(trace.x, range[0])) : 0;
      const last = fitY ? Math.min(trace.x.length - 1, indexAt(trace.x, range[1]) + 1) : trace.x.length - 1;
      for (let i = first; i <= last; i++) {
        const value = trace.values[i];
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (!(low <= high)) return [0, 1];
    const span = high - low;
    for (const limit of panel.limits) {
      const near = limit.value >= low - span && limit.value <= high + span;
      if (limit.failed || near) [low, high] = [Math.min(low, limit.value), Math.max(high, limit.value)];
    }
    const pad = high > low ? (high - low) * 0.09 : Math.abs(high) * 0.1 || 1;
    return [low - pad, high + pad];
  });

  const makeHead = (panel, left, width) => {
    const colours = traceColours(panel);
    const owners = new Set(panel.traces.map((trace) => trace.name.slice(0, trace.name.lastIndexOf(".") + 1)));
    const owner = owners.size === 1 ? [...owners][0] : "";
    const head = h("div.panel-head", null, h("b", null, panel.title.startsWith(owner) && owner ? panel.title : owner.replace(".", " ") + panel.title), h("span.unit", null, panel.unit && `[${panel.unit}]`),
      panel.traces.map((trace, i) =>
        h("button", { type: "button", "aria-pressed": !hiddenTraces.has(trace.name), title: trace.name + ": show or hide", onclick: () => toggleTrace(trace.name) },
          s("svg", { viewBox: "0 0 18 4" }, s("line", { x1: 0, x2: 18, y1: 2, y2: 2, stroke: css(colours[i]), "stroke-width": 2.4, "stroke-dasharray": trace.set ? "5 3" : null })),
          trace.name.slice(owner.length), h("output"))));
    head.style.cssText = `left:${left}px;width:${width}px`;
    root.append(head);
    return head;
  };

  /** Where everything goes. Heads are measured, because they take more lines in a narrow window. */
  const sizeNow = () => scroll.clientWidth + "×" + (wideWindow() ? scroll.clientHeight : 0);
  const arrangeRows = () => {
    plot.size = sizeNow();
    plot.panels = panels.filter(isShown);
    plot.lanes = lanes.filter(isShown);
    for (const panel of plot.panels) {
      panel.ghosts = panel.traces.map(ghostOf);
      panel.limits = data.checks.filter((check) => check.signal && panel.traces.some((trace) => trace.name === check.signal)).flatMap((check) =>
        ["low", "high"].filter((side) => check[side] !== null).map((side) => ({ value: check[side], side, check, failed: check.v === "failed" })));
    }
    for (const lane of plot.lanes) lane.ghost = plot.other?.curves.lanes.find((one) => one.name === lane.name) ?? null;
    const width = printing ? PRINT_WIDTH : Math.max(280, scroll.clientWidth);
    const narrow = width < NARROW;
    const names = Math.max(0, ...plot.lanes.map((lane) => textWidth(lane.name))) + 12;
    const left = narrow ? 56 : clamp(names, 96, 190);
    const events = eventRows(data, width - left - PLOT.right);
    let top = PLOT.top;
    const rows = events.map((row) => ({ ...row, top: (top += PLOT.event) - PLOT.event }));
    if (rows.length) top += 4;
    for (const lane of plot.lanes) {
      if (narrow) top += PLOT.name;
      [lane.top, top] = [top, top + PLOT.lane + (lane.ghost ? PLOT.ghost : 0)];
    }
    if (plot.lanes.length) top += 3;
    heads.forEach((head) => head.remove());
    heads = plot.panels.map((panel) => makeHead(panel, narrow ? 6 : left + 6, width - (narrow ? 6 : left + 6) - PLOT.right));
    root.classList.toggle("compared", Boolean(plot.other));
    const tall = heads.map((head) => head.offsetHeight);
    const fixed = tall.reduce((sum, one) => sum + one + PLOT.gap, 0);
    const wide = wideWindow();
    const room = (printing ? PRINT_HEIGHT : wide ? scroll.clientHeight - 2 : 640) - top - PLOT.axis - fixed;
    const each = Math.max(printing ? 40 : wide ? 66 : 78, Math.floor(room / Math.max(1, plot.panels.length)));
    plot.panels.forEach((panel, k) => {
      heads[k].style.top = top + "px";
      panel.top = top + tall[k];
      panel.bottom = panel.top + each;
      top = panel.bottom + PLOT.gap;
    });
    plot.geometry = { width, height: top + PLOT.axis, left, narrow, plotWidth: width - left - PLOT.right, bottom: top, rows };
    root.style.height = plot.geometry.height + "px";
    root.style.width = printing ? width + "px" : "";
  };

  /** Draw the curves again, `fine` times as fine as the screen: for paper and pictures. */
  const drawCurves = (fine = 1) => {
    drawn.forEach((one) => one.destroy());
    const { width, left } = plot.geometry;
    drawn = plot.panels.map((panel, k) => {
      const colours = traceColours(panel);
      const line = (trace, i, ghost) => ({
        show: !hiddenTraces.has(trace.name), spanGaps: false, points: { show: trace.x.length < 2 },
        stroke: css(colours[i]), alpha: ghost ? 0.38 : 1, width: (ghost ? 4 : trace.set ? 1.3 : 1.5) * fine, dash: trace.set && !ghost ? [5 * fine, 3 * fine] : undefined,
        // a setpoint holds until the next one; between samples that were left out a line tells more
        paths: trace.step ? uPlot.paths.stepped({ align: 1 }) : undefined,
      });
      const shown = [];
      const series = [];
      for (const [ghost, traces] of [[true, panel.ghosts], [false, panel.traces]]) {
        traces.forEach((trace, i) => {
          if (trace) {
            shown.push(trace);
            series.push(line(trace, i, ghost));
          }
        });
      }
      const place = h("div.curve");
      place.style.cssText = `top:${panel.top - PLOT.above}px;width:${width * fine}px;transform:scale(${1 / fine})`;
      curves.append(place);
      const grid = { stroke: css("--grid"), width: fine };
      const options = {
        width: width * fine, height: (panel.bottom - panel.top + 2 * PLOT.above) * fine, padding: [PLOT.above * fine, PLOT.right * fine, PLOT.above * fine, 0], legend: { show: false }, cursor: { show: false },
        scales: { x: { time: false, range: () => plot.range }, y: { range: () => plot.yRanges[k] } },
        // uPlot 1.6.16 draws no axis after a hidden one, so the time axis is there and empty
        axes: [{ size: 0, gap: 0, splits: () => [], values: () => [], grid: { show: false }, ticks: { show: false } }, {
          size: left * fine, gap: 6 * fine, space: 26 * fine, stroke: css("--dim"), font: `${10.5 * fine}px ${FONT}`, grid, ticks: { show: false },
          values: (_plot, splits, _axis, _space, step) => splits.map((value) => axisText(value, step)),
        }],
        series: [{}, ...series],
      };
      const one = new uPlot(options, joined(shown), place);
      one.root.parentNode.dataset.panel = panel.title;
      return { destroy: () => { one.destroy(); place.remove(); }, zoom: () => one.setScale("x", { min: plot.range[0], max: plot.range[1] }), canvas: one.ctx.canvas };
    });
  };

  const render = () => {
    arrangeRows();
    plot.yRanges = fit(plot.range);
    drawCurves(printing ? 3 : 1);
    redraw();
  };

  const redraw = () => {
    drawGround(ground, plot);
    drawOverlay(overlay, plot);
    drawCursors();
  };

  const toX = (t) => plot.geometry.left + ((t - plot.range[0]) / (plot.range[1] - plot.range[0])) * plot.geometry.plotWidth;
  const toTime = (x) => plot.range[0] + ((x - plot.geometry.left) / plot.geometry.plotWidth) * (plot.range[1] - plot.range[0]);
  const fromEvent = (event) => {
    const box = root.getBoundingClientRect();
    const x = event.clientX - box.left;
    if (x < plot.geometry.left || x > plot.geometry.width - PLOT.right || event.clientY - box.top > plot.geometry.bottom) return null;
    return toTime(x);
  };

  const drawCursors = () => {
    const taken = [];
    for (const name of ["a", "b", "hover"]) {
      const t = plot[name];
      const mark = marks[name];
      const x = t === null ? -1 : toX(t);
      mark.hidden = t === null || x < plot.geometry.left - 0.5 || x > plot.geometry.width - PLOT.right + 0.5;
      mark.style.left = x + "px";
      mark.style.height = plot.geometry.bottom + "px";
      const words = t === null ? "" : (name === "b" ? "B " : "") + seconds(t);
      const wide = textWidth(words) + 8;
      const from = clamp(x - wide / 2, 0, plot.geometry.width - wide);
      const free = !mark.hidden && taken.every(([a, b]) => from > b || from + wide < a);
      if (free) taken.push([from, from + wide]);
      mark.firstChild.textContent = words;
      mark.firstChild.hidden = !free; // the readout has the times of both cursors anyway
      mark.firstChild.style.left = from - x + "px";
    }
    for (const label of ground.querySelectorAll(".tick")) {
      const [from, to] = [Number(label.dataset.from), Number(label.dataset.to)];
      label.style.visibility = taken.some(([a, b]) => to > a - 2 && from < b + 2) ? "hidden" : "";
    }
    const t = plot.hover ?? plot.a;
    plot.panels.forEach((panel, k) => panel.traces.forEach((trace, i) => {
      const value = t === null ? null : valueAt(trace, t);
      const ghost = t === null || !panel.ghosts[i] ? null : valueAt(panel.ghosts[i], t);
      heads[k].querySelectorAll("output")[i].textContent = (value === null ? "" : plainNumber(value)) + (ghost === null ? "" : ` (${plainNumber(ghost)})`);
    }));
    drawPills(pills, overlay, plot, t, toX);
    const parts = [];
    if (t !== null) parts.push(h("b", null, seconds(t)));
    if (t !== null && data.zero !== null) parts.push(" fault ", h("b", null, relative(t, data.zero)));
    if (plot.a !== null && plot.b !== null) parts.push("  A–B ", h("b", null, relative(plot.b, plot.a)));
    readout.replaceChildren(...(parts.length ? parts : ["click: cursor · drag: zoom"]));
  };

  const setRange = (from, to) => {
    const width = clamp(to - from, 2e-5, all[1] - all[0]);
    const start = clamp(from, all[0], all[1] - width);
    plot.range = [start, start + width];
    plot.yRanges = fit(plot.range);
    drawn.forEach((one) => one.zoom());
    redraw();
    hooks.ranged(plot.range[0] <= all[0] && plot.range[1] >= all[1] ? null : plot.range);
  };

  const toggleTrace = (name) => {
    if (!hiddenTraces.delete(name)) hiddenTraces.add(name);
    render();
  };

  plot.setCursor = (t, second = false) => {
    plot[second ? "b" : "a"] = t;
    if (!second && t === null) plot.b = null;
    drawCursors();
    if (!second) hooks.moved(t);
  };
  /** Show a moment: with `since` zoom to the interval, else keep the zoom and move only as far as needed. */
  plot.goTo = (t, since = null) => {
    plot.hover = null;
    plot.setCursor(t);
    const width = plot.range[1] - plot.range[0];
    if (since !== null && since !== undefined) {
      const span = Math.max(Math.abs(t - since), 0.004);
      setRange(Math.min(t, since) - span * 0.75, Math.max(t, since) + span * 0.75);
    } else if (t < plot.range[0] + width * 0.03 || t > plot.range[1] - width * 0.03) setRange(t - width / 2, t + width / 2);
    if (!wideWindow()) root.scrollIntoView({ block: "start", behavior: "smooth" });
  };
  plot.setRange = setRange;
  plot.whole = () => setRange(...all);
  plot.toFault = () => {
    const moments = [data.zero, ...data.alarms.map((alarm) => alarm[0]), ...data.checks.filter((check) => check.v === "failed").map((check) => check.t)].filter((t) => t !== null);
    if (!moments.length) return;
    const [low, high] = [Math.min(...moments), Math.max(...moments)];
    const pad = Math.max((high - low) * 0.4, 0.02);
    setRange(low - pad, high + pad);
  };
  plot.render = render;
  /** Lay another run under the curves, moved by `shift` seconds; null takes it away. */
  plot.compare = (other, shift = 0) => {
    plot.other = other && { data: other, curves: decodeCurves(other), shift };
    render();
  };
  plot.visible = () => plot.panels.flatMap((panel) => panel.traces).filter((trace) => !hiddenTraces.has(trace.name));
  plot.picture = async () => {
    drawCurves(2);
    const canvases = drawn.map((one, k) => [one.canvas, plot.panels[k].top - PLOT.above]);
    await savePicture(ground, canvases, overlay, plot);
    drawCurves();
  };

  const zoomAround = (factor) => {
    const [from, to] = plot.range;
    const middle = plot.a !== null && plot.a >= from && plot.a <= to ? plot.a : (from + to) / 2;
    setRange(middle - (middle - from) * factor, middle + (to - middle) * factor);
  };
  root.addEventListener("keydown", (event) => {
    if (event.target !== root || event.ctrlKey || event.metaKey || event.altKey) return;
    const step = (plot.range[1] - plot.range[0]) / (event.shiftKey ? 1000 : 100);
    const here = plot.a ?? data.zero ?? (plot.range[0] + plot.range[1]) / 2;
    const actions = {
      ArrowLeft: () => plot.goTo(Math.max(all[0], here - step)), ArrowRight: () => plot.goTo(Math.min(all[1], here + step)),
      "+": () => zoomAround(0.6), "-": () => zoomAround(1 / 0.6), 0: plot.whole, Home: plot.whole, f: plot.toFault,
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    event.stopPropagation();
    actions[event.key]();
  });
  // The wheel zooms around the pointer; where it is needed for scrolling, only with Ctrl.
  let turned = 0;
  root.addEventListener("wheel", (event) => {
    const scrolls = !wideWindow() || scroll.scrollHeight > scroll.clientHeight + 2;
    const t = fromEvent(event);
    if (t === null || (scrolls && !event.ctrlKey && !event.metaKey)) return;
    event.preventDefault();
    if (!turned) {
      requestAnimationFrame(() => {
        const factor = Math.exp(clamp(turned * 0.0015, -1, 1));
        turned = 0;
        setRange(t - (t - plot.range[0]) * factor, t + (plot.range[1] - t) * factor);
      });
    }
    turned += event.deltaY;
  }, { passive: false });
  // A click sets the cursor, a drag zooms.
  let pressed = null;
  root.addEventListener("pointerdown", (event) => {
    pressed = event.button === 0 && !event.target.closest("button") && fromEvent(event) !== null ? [event.clientX, event.clientY] : null;
  });
  const pulled = (event) => [pressed[0], event.clientX].map((x) => clamp(x - root.getBoundingClientRect().left, plot.geometry.left, plot.geometry.width - PLOT.right)).sort((a, b) => a - b);
  const moved = (event) => {
    if (!pressed || Math.abs(event.clientX - pressed[0]) < 4) return;
    const [from, to] = pulled(event);
    selection.hidden = false;
    selection.style.cssText = `left:${from}px;width:${to - from}px;height:${plot.geometry.bottom}px`;
  };
  root.addEventListener("pointermove", (event) => {
    plot.hover = event.buttons ? null : fromEvent(event);
    drawCursors();
  });
  root.addEventListener("pointerleave", () => {
    plot.hover = null;
    drawCursors();
  });
  const released = (event) => {
    if (!pressed) return;
    const still = Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4;
    const [from, to] = pulled(event);
    const zoomed = !selection.hidden && to - from >= 4;
    pressed = null;
    selection.hidden = true;
    const t = still ? fromEvent(event) : null;
    if (t !== null) plot.setCursor(t, event.shiftKey && plot.a !== null);
    else if (zoomed) setRange(toTime(from), toTime(to));
  };
  const cancelled = () => {
    pressed = null;
    selection.hidden = true;
  };
  window.addEventListener("pointermove", moved);
  window.addEventListener("pointerup", released);
  window.addEventListener("pointercancel", cancelled);
  root.addEventListener("dblclick", (event) => { if (!event.target.closest("button")) plot.whole(); });

  const button = (text, title, action, pressedState) => h("button.tool", { type: "button", title, "aria-pressed": pressedState, onclick: action }, text);
  const fitButton = button("Fit Y", "Scale the curves to what is visible", () => {
    fitY = !fitY;
    fitButton.setAttribute("aria-pressed", fitY);
    render();
  }, String(fitY));
  const choice = (item, label, small) => {
    const box = h("input", { type: "checkbox", checked: isShown(item), onchange: () => { shownChoice.set(item.key, box.checked); render(); } });
    return h("label", null, box, label, h("small", null, small));
  };
  const menu = h("details.menu", null, h("summary.tool", null, "Signals ▾"), h("div", null,
    panels.length > 0 && h("h3", null, "Curves"), panels.map((panel) => choice(panel, panel.title, `${panel.unit && `[${panel.unit}] `}${panel.traces.map((trace) => trace.name).join(", ")}${panel.idle ? " (at rest)" : ""}`)),
    lanes.length > 0 && h("h3", null, "States, bits and words"), lanes.map((lane) => choice(lane, lane.name, lane.kind + (lane.idle ? ", never changes" : "")))));
  const closeMenu = (event) => { if (menu.open && !menu.contains(event.target)) menu.open = false; };
  document.addEventListener("click", closeMenu);
  const toolbar = h("div.toolbar", null, button("Whole case", "Key 0, or double-click", plot.whole), data.zero !== null && button("Around the fault", "Key f", plot.toFault), fitButton, menu, hooks.tools(plot),
    button("Save picture", "PNG of what is visible", plot.picture), button("CSV", "The visible signals in the visible time as a table", () => saveCsv(plot)), readout);
  pane.append(toolbar, scroll);

  render();
  const observer = new ResizeObserver(() => {
    if (plot.size !== sizeNow() && scroll.clientWidth && !printing) render();
  });
  observer.observe(scroll);
  plot.destroy = () => {
    observer.disconnect();
    window.removeEventListener("pointermove", moved);
    window.removeEventListener("pointerup", released);
    window.removeEventListener("pointercancel", cancelled);
    document.removeEventListener("click", closeMenu);
    drawn.forEach((one) => one.destroy());
  };
  return plot;
}
