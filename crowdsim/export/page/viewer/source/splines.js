// Uniform cubic B-splines through rows of samples, as crowdsim/motion/deformed/spline_kernels.py has them.

/** The span that holds a time [s], and the weights of its four samples there, into `out`. `step` is the time between samples. */
export function spanOf(out, time, step, count) {
  const place = Math.min(Math.max(time / step, 1), count - 2);
  out.span = Math.min(Math.floor(place), count - 3);
  setWeights(out, place - out.span);
  return out;
}

function setWeights(out, share) {
  const rest = 1 - share, square = share * share, cube = square * share;
  out.w0 = (rest * rest * rest) / 6;
  out.w1 = (3 * cube - 6 * square + 4) / 6;
  out.w2 = (-3 * cube + 3 * square + 3 * share + 1) / 6;
  out.w3 = cube / 6;
}

/** Value of a column of samples with `columns` columns, at a span with its weights. */
export function valueAt(samples, columns, column, at) {
  const i = (at.span - 1) * columns + column;
  return at.w0 * samples[i] + at.w1 * samples[i + columns] + at.w2 * samples[i + 2 * columns]
    + at.w3 * samples[i + 3 * columns];
}

const look = { span: 0, w0: 0, w1: 0, w2: 0, w3: 0 };

/** Seconds at which a column that never falls first reaches a target, and the span, from span `start` on. */
export function timeOfValue(samples, columns, column, target, step, count, start) {
  let span = start;
  while (span < count - 3) {
    look.span = span;
    look.w0 = 0;
    look.w1 = 1 / 6;
    look.w2 = 4 / 6;
    look.w3 = 1 / 6;
    if (valueAt(samples, columns, column, look) >= target) break;
    span += 1;
  }
  look.span = span;
  let low = 0, high = 1;
  for (let k = 0; k < 24; k++) {
    const middle = 0.5 * (low + high);
    setWeights(look, middle);
    if (valueAt(samples, columns, column, look) < target) low = middle;
    else high = middle;
  }
  return { time: (span + high) * step, span };
}
