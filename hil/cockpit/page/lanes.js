// Canvases of our own next to the curves: states as lanes with their texts, and one signal over another.

import { short, unit } from "./dom.js";
import { COLOURS, colour, reduced } from "./plot.js";

const ROW = 26;

function prepared(canvas, width, height) {
  const ratio = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "12px system-ui, sans-serif";
  return pen;
}

/** States over time: a lane each, a field with its text for each value. */
export class Lanes {
  constructor(host) {
    this.host = host;
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", "States over time");
    host.append(this.canvas);
  }

  /** `lanes` are {series, label, texts}; `left` and `right` are the margins of the curves. */
  show(lanes, from, to, left, right) {
    const width = this.host.clientWidth;
    const pen = prepared(this.canvas, width, lanes.length * ROW);
    const inner = width - left - right;
    const x = (time) => left + ((time - from) / (to - from)) * inner;
    lanes.forEach(({ series, label, texts }, row) => {
      const top = row * ROW;
      pen.fillStyle = colour("--ink-2");
      pen.textAlign = "right";
      pen.fillText(fitted(pen, label, left - 8), left - 8, top + 17);
      pen.textAlign = "left";
      const first = Math.max(0, series.index(from) - 1);
      const end = Math.min(series.length, series.index(to) + 1);
      let place = first;
      while (place < end) {
        const value = series.values[place];
        let next = place + 1;
        while (next < end && series.values[next] === value) next++;
        const begin = Math.max(left, x(series.times[place]));
        const stop = Math.min(left + inner, next < series.length ? x(series.times[Math.min(next, series.length - 1)]) : x(series.times[series.length - 1]));
        if (stop > begin) {
          pen.fillStyle = colour(COLOURS[Math.abs(Math.round(value)) % COLOURS.length]);
          pen.globalAlpha = 0.22;
          pen.fillRect(begin, top + 3, Math.max(1, stop - begin), ROW - 6);
          pen.globalAlpha = 1;
          pen.fillRect(begin, top + 3, 2, ROW - 6);
          pen.fillStyle = colour("--ink");
          const said = texts?.[String(Math.round(value))] ?? short(value);
          if (stop - begin > 24) pen.fillText(fitted(pen, said.toLowerCase().replaceAll("_", " "), stop - begin - 10), begin + 6, top + 17);
        }
        place = next;
      }
    });
  }
}

function fitted(pen, said, width) {
  if (pen.measureText(said).width <= width) return said;
  let cut = said;
  while (cut.length > 1 && pen.measureText(`${cut}\u2026`).width > width) cut = cut.slice(0, -1);
  return cut.length > 1 ? `${cut}\u2026` : "";
}

/** One signal over another. */
export class Xy {
  constructor(host) {
    this.host = host;
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    host.append(this.canvas);
  }

  show(horizontal, vertical, labels, from, to) {
    const width = this.host.clientWidth;
    const height = Math.min(420, Math.max(240, width * 0.5));
    const pen = prepared(this.canvas, width, height);
    this.canvas.setAttribute("aria-label", `${labels[1].name} over ${labels[0].name}`);
    const [times, values] = reduced(vertical, from, to, 2000);
    const points = [];
    for (let place = 0; place < times.length; place++) {
      const across = horizontal.at(times[place]);
      if (across !== null) points.push([across, values[place]]);
    }
    const left = 82;
    const bottom = 44;
    const inner = { x: left, y: 10, w: width - left - 16, h: height - bottom - 10 };
    const spanOf = (axis) => {
      let low = Infinity;
      let high = -Infinity;
      for (const point of points) {
        low = Math.min(low, point[axis]);
        high = Math.max(high, point[axis]);
      }
      if (!Number.isFinite(low)) return [-1, 1];
      const air = (high - low) * 0.06 || Math.max(Math.abs(high) * 1e-3, 1e-3);
      return [low - air, high + air];
    };
    const spans = [spanOf(0), spanOf(1)];
    const x = (value) => inner.x + ((value - spans[0][0]) / (spans[0][1] - spans[0][0])) * inner.w;
    const y = (value) => inner.y + inner.h - ((value - spans[1][0]) / (spans[1][1] - spans[1][0])) * inner.h;
    pen.strokeStyle = colour("--grid");
    pen.fillStyle = colour("--ink-2");
    pen.lineWidth = 1;
    for (const tick of ticks(...spans[0], Math.max(2, inner.w / 110))) {
      line(pen, x(tick), inner.y, x(tick), inner.y + inner.h);
      pen.textAlign = "center";
      pen.fillText(String(tick).replace("-", "\u2212"), x(tick), inner.y + inner.h + 16);
    }
    for (const tick of ticks(...spans[1], Math.max(2, inner.h / 44))) {
      line(pen, inner.x, y(tick), inner.x + inner.w, y(tick));
      pen.textAlign = "right";
      pen.fillText(String(tick).replace("-", "\u2212"), inner.x - 8, y(tick) + 4);
    }
    pen.textAlign = "center";
    pen.fillText(`${labels[0].name}, ${unit(labels[0].unit)}`, inner.x + inner.w / 2, height - 8);
    pen.save();
    pen.translate(14, inner.y + inner.h / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(`${labels[1].name}, ${unit(labels[1].unit)}`, 0, 0);
    pen.restore();
    pen.strokeStyle = colour(COLOURS[0]);
    pen.lineWidth = 1.5;
    pen.beginPath();
    points.forEach((point, place) => (place ? pen.lineTo(x(point[0]), y(point[1])) : pen.moveTo(x(point[0]), y(point[1]))));
    pen.stroke();
    const last = points.at(-1);
    if (last) {
      pen.fillStyle = colour(COLOURS[1]);
      pen.beginPath();
      pen.arc(x(last[0]), y(last[1]), 4, 0, 2 * Math.PI);
      pen.fill();
    }
  }
}

function line(pen, fromX, fromY, toX, toY) {
  pen.beginPath();
  pen.moveTo(Math.round(fromX) + 0.5, Math.round(fromY) + 0.5);
  pen.lineTo(Math.round(toX) + 0.5, Math.round(toY) + 0.5);
  pen.stroke();
}

function ticks(low, high, most) {
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= rough);
  const found = [];
  for (let place = Math.ceil(low / step); place * step <= high; place++) found.push(Number((place * step).toPrecision(10)));
  return found;
}
