// The plot of a case. Plotly draws curves and axes and does the zooming; cursor, legends and everything that marks a
// moment (faults, alarms, checks, states) are drawn over it by overlay.js from the same time range.
const PLOT = { right: 14, bottom: 26, top: 4, lane: 19, event: 19, head: 19, gap: 7 };
const shownChoice = new Map(); // what the reader switched on or off stays so in the next case
const hiddenTraces = new Set();
let fitY = true;
let printing = false;

/** Make the plot library ready: read it from the page, or from beside it. */
async function loadPlotly() {
  if (window.Plotly) return;
  if (FOLDER) await loadScript("plotly.js");
  else document.head.append(append(document.createElement("script"), [$("#plotly-source").textContent]));
}

const traceColours = (panel) => {
  const acts = ["--s-act", "--s-3", "--s-4", "--s-6", "--s-8"];
  const sets = ["--s-set", "--s-5", "--s-7"];
  let a = 0;
  let b = 0;
  return panel.traces.map((trace) => (trace.set ? sets[b++ % sets.length] : acts[a++ % acts.length]));
};

/** Build the plot of a case into `pane`; returns its remote control. */
function makePlot(data, pane, hooks) {
  const times = data.times.map(decodeNumbers);
  const panels = data.panels.map((panel) => ({
    ...panel, key: `panel ${panel.title} [${panel.unit}] ${panel.traces[0].name.split(".")[0]}`,
    traces: panel.traces.map((trace) => ({ ...trace, x: times[trace.t], values: decodeNumbers(trace.y) })),
  }));
  const lanes = data.lanes.map((lane) => ({ ...lane, key: "lane " + lane.name }));
  const isShown = (item) => shownChoice.get(item.key) ?? item.on;
  const all = [data.start, Math.max(data.end, data.start + 1e-6)];
  const plot = { data, all, range: [...all], yRanges: [], a: null, b: null, hover: null, geometry: null };
  const scroll = h("div.plot-scroll");
  const root = h("div.plot", { tabindex: 0, role: "group", "aria-label": "Plot. Left and right move the cursor, plus and minus zoom, 0 shows the whole case, f goes to the fault." });
  const gd = h("div.gd");
  const overlay = s("svg", { class: "overlay", "aria-hidden": "true" });
  const marks = { hover: h("div.cursor", null, h("i")), a: h("div.cursor.locked", null, h("i")), b: h("div.cursor.locked", null, h("i")) };
  const pills = s("svg", { class: "overlay", "aria-hidden": "true" });
  root.append(gd, overlay, pills, marks.hover, marks.a, marks.b);
  scroll.append(root);
  const readout = h("span.readout", { role: "status" });
  let heads = [];
  let busy = false;

  const fit = (range) => plot.panels.map((panel) => {
    let low = Infinity;
    let high = -Infinity;
    for (const trace of panel.traces) {
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

  const arrangeRows = () => {
    plot.panels = panels.filter(isShown);
    plot.lanes = lanes.filter(isShown);
    for (const panel of plot.panels) {
      panel.limits = data.checks.filter((check) => check.signal && panel.traces.some((trace) => trace.name === check.signal)).flatMap((check) =>
        ["low", "high"].filter((side) => check[side] !== null).map((side) => ({ value: check[side], side, check, failed: check.v === "failed" })));
    }
    const width = printing ? 1030 : Math.max(320, scroll.clientWidth);
    const names = Math.max(0, ...plot.lanes.map((lane) => lane.name.length)) * 5.9 + 14;
    const left = width < 620 ? 66 : clamp(names, 96, 150);
    const events = eventRows(data, width - left - PLOT.right);
    let top = PLOT.top;
    const rows = events.map((row) => ({ ...row, top: (top += PLOT.event) - PLOT.event }));
    if (rows.length) top += 4;
    for (const lane of plot.lanes) [lane.top, top] = [top, top + PLOT.lane];
    if (plot.lanes.length) top += 3;
    const wide = matchMedia("(min-width: 1101px)").matches && !printing;
    const room = (printing ? 520 : wide ? scroll.clientHeight - 2 : 640) - top - PLOT.bottom;
    const each = Math.max(printing ? 72 : wide ? 92 : 104, Math.floor(room / Math.max(1, plot.panels.length)));
    for (const panel of plot.panels) {
      panel.top = top + PLOT.head;
      panel.bottom = top + each - PLOT.gap;
      top += each;
    }
    const height = top + PLOT.bottom;
    plot.geometry = { width, height, left, plotWidth: width - left - PLOT.right, bottom: top, rows };
    root.style.height = height + "px";
    root.style.width = printing ? width + "px" : "";
  };

  const layout = () => {
    const { width, height, left, bottom } = plot.geometry;
    const inner = bottom - PLOT.top;
    const domain = (from, to) => [clamp(1 - (to - PLOT.top) / inner, 0, 1), clamp(1 - (from - PLOT.top) / inner, 0, 1)];
    const first = plot.panels.length ? plot.panels[0].top - PLOT.head : bottom;
    const grid = css("--grid");
    const axis = { fixedrange: true, zeroline: true, zerolinecolor: css("--line"), zerolinewidth: 1, gridcolor: grid, tickfont: { size: 10.5 }, tickcolor: css("--line"), automargin: false, exponentformat: "SI" };
    const result = {
      width, height, margin: { l: left, r: PLOT.right, t: PLOT.top, b: PLOT.bottom, pad: 0 }, showlegend: false, hovermode: false, dragmode: "zoom",
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { family: "system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif", size: 11, color: css("--dim") },
      xaxis: { range: plot.range, minallowed: all[0] - 1e-3, maxallowed: all[1] + 1e-3, gridcolor: grid, zeroline: false, ticksuffix: " s", tickfont: { size: 10.5 }, anchor: plot.panels.length ? "y" + (plot.panels.length + 1) : "y", side: "bottom", automargin: false },
      yaxis: { domain: first > PLOT.top + 1 ? domain(PLOT.top, first) : [0.999, 1], range: [0, 1], fixedrange: true, showticklabels: false, showgrid: false, zeroline: false },
    };
    plot.panels.forEach((panel, k) => {
      result["yaxis" + (k + 2)] = { ...axis, anchor: "x", domain: domain(panel.top, panel.bottom), range: plot.yRanges[k], nticks: Math.max(3, Math.floor((panel.bottom - panel.top) / 26)) };
    });
    return result;
  };

  const curves = () => [
    { x: [all[0]], y: [0.5], mode: "markers", marker: { opacity: 0 }, hoverinfo: "skip" },
    ...plot.panels.flatMap((panel, k) => {
      const colours = traceColours(panel);
      return panel.traces.map((trace, i) => ({
        x: trace.x, y: trace.values, yaxis: "y" + (k + 2), mode: trace.x.length < 2 ? "markers" : "lines", hoverinfo: "skip", visible: !hiddenTraces.has(trace.name),
        line: { color: css(colours[i]), width: trace.set ? 1.3 : 1.5, dash: trace.set ? "5px,3px" : "solid" },
      }));
    }),
  ];

  const render = () => {
    arrangeRows();
    plot.yRanges = fit(plot.range);
    heads.forEach((head) => head.remove());
    heads = plot.panels.map((panel) => {
      const colours = traceColours(panel);
      const owners = new Set(panel.traces.map((trace) => trace.name.slice(0, trace.name.lastIndexOf(".") + 1)));
      const owner = owners.size === 1 ? [...owners][0] : "";
      const head = h("div.panel-head", null, h("b", null, panel.title.startsWith(owner) && owner ? panel.title : owner.replace(".", " ") + panel.title), h("span.unit", null, panel.unit && `[${panel.unit}]`),
        panel.traces.map((trace, i) =>
          h("button", { type: "button", "aria-pressed": !hiddenTraces.has(trace.name), title: trace.name + ": show or hide", onclick: () => toggleTrace(trace.name) },
            s("svg", { viewBox: "0 0 18 4" }, s("line", { x1: 0, x2: 18, y1: 2, y2: 2, stroke: css(colours[i]), "stroke-width": 2.4, "stroke-dasharray": trace.set ? "5 3" : null })),
            trace.name.slice(owner.length), h("output"))));
      head.style.cssText = `left:${plot.geometry.left + 6}px;top:${panel.top - PLOT.head}px;right:${PLOT.right}px`;
      root.append(head);
      return head;
    });
    busy = true;
    const config = { displayModeBar: false, displaylogo: false, responsive: false, doubleClick: false, scrollZoom: false, showTips: false };
    const done = gd.data ? Plotly.react(gd, curves(), layout(), config) : Plotly.newPlot(gd, curves(), layout(), config);
    done.then(() => { busy = false; });
    redraw();
  };

  const redraw = () => {
    drawOverlay(overlay, plot);
    drawCursors();
  };

  const toX = (t) => plot.geometry.left + ((t - plot.range[0]) / (plot.range[1] - plot.range[0])) * plot.geometry.plotWidth;
  const fromEvent = (event) => {
    const box = root.getBoundingClientRect();
    const x = event.clientX - box.left - plot.geometry.left;
    if (x < 0 || x > plot.geometry.plotWidth || event.clientY - box.top > plot.geometry.bottom) return null;
    return plot.range[0] + (x / plot.geometry.plotWidth) * (plot.range[1] - plot.range[0]);
  };

  const drawCursors = () => {
    for (const name of ["hover", "a", "b"]) {
      const t = plot[name];
      const mark = marks[name];
      const x = t === null ? -1 : toX(t);
      mark.hidden = t === null || x < plot.geometry.left - 0.5 || x > plot.geometry.width - PLOT.right + 0.5;
      mark.style.left = x + "px";
      mark.style.height = plot.geometry.bottom + "px";
      mark.firstChild.textContent = t === null ? "" : (name === "b" ? "B " : "") + seconds(t);
    }
    const t = plot.hover ?? plot.a;
    plot.panels.forEach((panel, k) => panel.traces.forEach((trace, i) => {
      const at = t === null ? -1 : indexAt(trace.x, t + 1e-9);
      heads[k].querySelectorAll("output")[i].textContent = at < 0 ? "" : plainNumber(trace.values[at]);
    }));
    drawPills(pills, plot, t, toX);
    const parts = [];
    if (t !== null) parts.push(h("b", null, seconds(t)));
    if (t !== null && data.zero !== null) parts.push(" fault ", h("b", null, relative(t, data.zero)));
    if (plot.a !== null && plot.b !== null) parts.push("  A–B ", h("b", null, relative(plot.b, plot.a)));
    readout.replaceChildren(...(parts.length ? parts : ["click: cursor · shift-click: second cursor · drag: zoom"]));
  };

  const setRange = (from, to) => {
    const width = clamp(to - from, 2e-5, all[1] - all[0]);
    const start = clamp(from, all[0], all[1] - width);
    plot.range = [start, start + width];
    plot.yRanges = fit(plot.range);
    const change = { "xaxis.range": [...plot.range] };
    plot.yRanges.forEach((range, k) => { change[`yaxis${k + 2}.range`] = range; });
    busy = true;
    Plotly.relayout(gd, change).then(() => { busy = false; });
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
    if (!matchMedia("(min-width: 1101px)").matches) root.scrollIntoView({ block: "start", behavior: "smooth" });
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
  plot.traces = () => plot.panels.map((panel) => panel.title);

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
    const scrolls = !matchMedia("(min-width: 1101px)").matches || scroll.scrollHeight > scroll.clientHeight + 2;
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
  root.addEventListener("pointermove", (event) => {
    plot.hover = event.buttons ? null : fromEvent(event);
    drawCursors();
  });
  root.addEventListener("pointerleave", () => {
    plot.hover = null;
    drawCursors();
  });
  let pressed = null;
  root.addEventListener("pointerdown", (event) => { pressed = event.button === 0 && !event.target.closest("button") ? [event.clientX, event.clientY] : null; }, true);
  const released = (event) => {
    if (!pressed) return;
    const still = Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4;
    pressed = null;
    const t = still ? fromEvent(event) : null;
    if (t !== null) plot.setCursor(t, event.shiftKey && plot.a !== null);
  };
  window.addEventListener("pointerup", released, true);
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
    panels.length > 0 && h("h3", null, "Curves"), panels.map((panel) => choice(panel, panel.title, `${panel.unit && `[${panel.unit}] `}${panel.traces.map((trace) => trace.name).join(", ")}`)),
    lanes.length > 0 && h("h3", null, "States, bits and words"), lanes.map((lane) => choice(lane, lane.name, lane.kind))));
  document.addEventListener("click", (event) => { if (menu.open && !menu.contains(event.target)) menu.open = false; });
  const toolbar = h("div.toolbar", null, button("Whole case", "Key 0, or double-click", plot.whole), data.zero !== null && button("Around the fault", "Key f", plot.toFault), fitButton, menu,
    button("Save picture", "PNG of what is visible", () => savePicture(gd, overlay, plot, data.id)), readout);
  pane.append(toolbar, scroll);

  render();
  gd.on("plotly_relayouting", () => {
    plot.range = [...gd._fullLayout.xaxis.range];
    redraw();
  });
  gd.on("plotly_relayout", (event) => {
    if (busy || !Object.keys(event).some((key) => key.startsWith("xaxis"))) return;
    setRange(...gd._fullLayout.xaxis.range);
  });
  const observer = new ResizeObserver(() => {
    const size = scroll.clientWidth + "×" + (matchMedia("(min-width: 1101px)").matches ? scroll.clientHeight : 0);
    if (plot.size && plot.size !== size && scroll.clientWidth) render();
    plot.size = size;
  });
  observer.observe(scroll);
  plot.destroy = () => {
    observer.disconnect();
    window.removeEventListener("pointerup", released, true);
    Plotly.purge(gd);
  };
  return plot;
}
