// A panel with curves over time or over another signal, drawn by uPlot; no more points than the screen has pixels.

import { h, unit } from "./dom.js";

export const COLOURS = ["--curve-1", "--curve-2", "--curve-3", "--curve-4", "--curve-5", "--curve-6"];

/** A field of the colour of a curve, for legends. */
export function dot(number) {
  const element = h("span.dot");
  element.style.background = `var(${COLOURS[number % COLOURS.length]})`;
  return element;
}

/** Value of a custom property of the page: colours follow light and dark. */
export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** Lowest and highest value of every pixel between two times, in the order in which they came: [times, values]. */
export function reduced(series, from, to, pixels) {
  const first = Math.max(0, series.index(from) - 1);
  const end = Math.min(series.length, series.index(to) + 1);
  const count = end - first;
  if (count <= 4 * pixels) return [series.times.subarray(first, end), series.values.subarray(first, end)];
  const times = [];
  const values = [];
  const width = (to - from) / pixels;
  let place = first;
  while (place < end) {
    const limit = from + (Math.floor((series.times[place] - from) / width) + 1) * width;
    let low = place;
    let high = place;
    const begin = place;
    while (place < end && series.times[place] < limit) {
      if (series.values[place] < series.values[low]) low = place;
      if (series.values[place] > series.values[high]) high = place;
      place++;
    }
    if (place === begin) place++;
    for (const one of [...new Set([begin, Math.min(low, high), Math.max(low, high), place - 1])]) {
      times.push(series.times[one]);
      values.push(series.values[one]);
    }
  }
  return [times, values];
}

/** Join curves with times of their own into what uPlot draws: one list of times, and values or null or undefined. */
function joined(curves) {
  if (curves.length === 1) return [curves[0][0], curves[0][1]];
  const same = curves.every(
    (curve) =>
      curve[0].length === curves[0][0].length &&
      curve[0][0] === curves[0][0][0] &&
      curve[0][curve[0].length - 1] === curves[0][0][curves[0][0].length - 1],
  );
  if (same && curves.every((curve) => curve.plain)) return [curves[0][0], ...curves.map((curve) => curve[1])];
  return uPlot.join(curves.map((curve) => [curve[0], curve[1]]));
}

/** One panel: curves of one unit over a common time. */
export class Panel {
  /**
   * @param {HTMLElement} host where it is drawn
   * @param {{names: string[], labels: string[], unit: string, colours: number[], steps?: boolean[], height?: number,
   *   axis?: boolean, key?: string, select?: (from: number, to: number) => void, draw?: (plot: uPlot) => void}} options
   */
  constructor(host, options) {
    this.host = host;
    this.options = options;
    this.plot = null;
    this.observer = new ResizeObserver(() => this.#resize());
    this.observer.observe(host);
    this.#make();
  }

  #make() {
    const { options, host } = this;
    const ink = colour("--ink-2");
    const grid = { stroke: colour("--grid"), width: 1 };
    const axis = {
      stroke: ink,
      grid,
      ticks: { stroke: colour("--grid"), width: 1, size: 4 },
      font: "12px system-ui, sans-serif",
    };
    this.plot?.destroy();
    this.plot = new uPlot(
      {
        width: Math.max(120, host.clientWidth),
        height: options.height || 160,
        legend: { show: false },
        cursor: {
          sync: options.key ? { key: options.key, setSeries: false } : undefined,
          drag: { x: Boolean(options.select), y: false, setScale: false },
          points: { size: 6 },
          focus: { prox: -1 },
        },
        scales: { x: { time: false, auto: false }, y: { range: (_, low, high) => span(low, high) } },
        axes: [
          { ...axis, show: true, size: options.axis === false ? 8 : 34, values: options.axis === false ? () => [] : (_, all) => all.map((one) => `${Number(one.toFixed(6))} s`) },
          { ...axis, size: 66, space: 26, values: (_, all) => all.map((one) => String(Number(one.toPrecision(7))).replace("-", "\u2212")), label: unit(options.unit), labelSize: 16, labelFont: "12px system-ui, sans-serif" },
        ],
        series: [
          {},
          ...options.names.map((name, place) => ({
            label: options.labels[place],
            stroke: colour(COLOURS[options.colours[place] % COLOURS.length]),
            width: 1.5,
            points: { show: false },
            paths: options.steps?.[place] ? uPlot.paths.stepped({ align: 1 }) : undefined,
            spanGaps: true,
          })),
        ],
        hooks: {
          setSelect: [
            (plot) => {
              if (plot.select.width > 4 && options.select) {
                options.select(plot.posToVal(plot.select.left, "x"), plot.posToVal(plot.select.left + plot.select.width, "x"));
              }
              if (plot.select.width > 0) plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
            },
          ],
          drawClear: options.behind ? [options.behind] : [],
          draw: options.draw ? [options.draw] : [],
        },
      },
      [[], ...options.names.map(() => [])],
      host,
    );
  }

  #resize() {
    const width = this.host.clientWidth;
    if (this.plot && width > 0 && width !== this.plot.width) this.plot.setSize({ width, height: this.plot.height });
  }

  /** Draw curves between two times. `series` are in the order of the names. */
  show(series, from, to) {
    const pixels = Math.max(50, this.plot.width - 70);
    const curves = series.map((one) => {
      const curve = reduced(one, from, to, pixels);
      curve.plain = curve[0] instanceof Float64Array;
      return curve;
    });
    this.plot.batch(() => {
      this.plot.setData(joined(curves), false);
      this.plot.setScale("x", { min: from, max: to });
    });
  }

  /** Take the colours of the page anew. */
  restyle() {
    this.#make();
  }

  destroy() {
    this.observer.disconnect();
    this.plot.destroy();
  }
}

/** Range of a scale: some air around the curve, and never nothing. */
function span(low, high) {
  if (low === null || high === null || low === undefined) return [-1, 1];
  const least = Math.max(Math.abs(low), Math.abs(high)) * 1e-6 || 1e-3;
  const air = Math.max((high - low) * 0.08, least);
  return [low - air, high + air];
}
