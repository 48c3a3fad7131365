// Channels that are calculated of others, over what is shown.

import { Series } from "./samples.js";

/** What a channel may be: name -> words, how many signals it takes, whether it takes a window. */
export const OPERATIONS = {
  difference: { words: "difference a \u2212 b", inputs: 2, window: false },
  derivative: { words: "derivative of a", inputs: 1, window: false },
  mean: { words: "moving mean of a", inputs: 1, window: true },
};

/** Calculate a channel between two times. `window` is the length of the mean in s. */
export function calculated(operation, a, b, window, from, to) {
  const first = Math.max(0, a.index(from - (operation === "mean" ? window : 0)) - 1);
  const end = Math.min(a.length, a.index(to) + 1);
  const times = a.times.subarray(first, end);
  const source = a.values.subarray(first, end);
  const values = new Float64Array(times.length);
  if (operation === "difference") {
    let other = b.length ? Math.max(0, b.index(times[0]) - 1) : 0;
    for (let place = 0; place < times.length; place++) {
      while (other + 1 < b.length && b.times[other + 1] <= times[place]) other++;
      values[place] = b.length ? source[place] - b.values[other] : NaN;
    }
  } else if (operation === "derivative") {
    for (let place = 1; place < times.length; place++) {
      const step = times[place] - times[place - 1];
      values[place] = step > 0 ? (source[place] - source[place - 1]) / step : values[place - 1];
    }
    if (values.length > 1) values[0] = values[1];
  } else {
    let sum = 0;
    let oldest = 0;
    for (let place = 0; place < times.length; place++) {
      sum += source[place];
      while (times[place] - times[oldest] >= window && oldest < place) sum -= source[oldest++];
      values[place] = sum / (place - oldest + 1);
    }
  }
  return new Series(times, values, times.length, a.gaps);
}

/** Unit of a calculated channel. */
export function derivedUnit(operation, of) {
  if (operation !== "derivative" || !of) return of;
  if (of.endsWith("/s")) return `${of}2`;
  if (of.endsWith("/s2")) return `${of.slice(0, -1)}3`;
  return `${of}/s`;
}
