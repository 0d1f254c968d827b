// Footsteps of one track: crowdsim/motion/deformed/plan_kernels.py in JavaScript.

import {
  AHEAD, COLUMNS, DROP, HEADING, PHASE, SHARE, STANCE, TWIST, X, Y,
  hipOf, lacking, pelvisOf, standAnkle, trackAt,
} from "./body_parts.js";
import { timeOfValue } from "./splines.js";

// Columns of a step: the print, the ankle as the foot lifts and as it lands, and how far it swings out.
export const PRINT = 0, LIFT = 3, LAND = 11, ASIDE = 19, STEP_COLUMNS = 20;
export const PAD = 14; // samples before and after each track
export const STEP = 0.1; // seconds between samples

const BEYOND = 3;
const REFERENCE = 0.26, STAND = 0.06;
const LONGEST_LOOK = 0.6;
const AT_REST = 1e-4, DIGITS = 1.2e-7;
const SLOWEST = 0.45, TURN_STRIDE = 0.2, LARGEST_SHARE = 1.25;
const APART = 1.8, STOOD = 1.2, PASSING = 0.095;
const LONG = 0.32, LONG_BY = 0.12, MOST_ASIDE = 0.2, DEEPEST = 0.2;
const HEEL_FROM = 0.2, HEEL_BY = 0.3, HEEL_MOST = 1.15;
const HANN = [0.09549150281252627, 0.6545084971874737, 1, 0.6545084971874737, 0.09549150281252627];
const SIDEWAYS = 1.4, TWISTED = 0.7, WALKING = 0.4;
const ASKED = [0, 0.05, 0.15, 0.3, 0.4, 0.5, 0.55, 0.6];

/** Plan where the feet of one body stand. track: rows of x, y, heading without jumps, phase. */
export function planSteps(model, track, rows) {
  const count = rows + 2 * PAD;
  const samples = fillSamples(model, track, rows, count);
  const half = Math.floor(2 * samples[PHASE]) - BEYOND;
  const end = Math.floor(2 * samples[(count - 1) * COLUMNS + PHASE]) + BEYOND + 1;
  const plan = {
    samples, count, half, step: STEP, steps: new Float64Array((end - half) * STEP_COLUMNS), rows: end - half,
  };
  planPrints(model, plan);
  planDrops(model, plan);
  planSwings(model, plan);
  return plan;
}

function smooth(samples, column, count) {
  const out = new Float64Array(count);
  for (let row = 0; row < count; row++) {
    let total = 0;
    for (let k = 0; k < 5; k++) {
      total += HANN[k] * samples[Math.min(Math.max(row + k - 2, 0), count - 1) * COLUMNS + column];
    }
    out[row] = total / 2.5;
  }
  for (let row = 0; row < count; row++) samples[row * COLUMNS + column] = out[row];
}

const rates = [0, 0, 0, 0];

function speeds(samples, row, count) {
  const before = Math.max(row - 1, 0), after = Math.min(row + 1, count - 1);
  for (let k = 0; k < 4; k++) {
    rates[k] = (samples[after * COLUMNS + k] - samples[before * COLUMNS + k]) / ((after - before) * STEP);
  }
  return rates;
}

function stands(phase) {
  const halves = 2 * phase;
  return Math.abs(halves - Math.floor(halves) - 2 * STAND) < Math.max(AT_REST, DIGITS * halves);
}

function hipTurn(ahead, side) {
  const angle = Math.abs(Math.atan2(side, ahead));
  if (angle >= SIDEWAYS) return 0;
  const turn = Math.min(angle, (TWISTED * (SIDEWAYS - angle)) / (SIDEWAYS - TWISTED));
  const walking = Math.min(Math.sqrt(ahead * ahead + side * side) / WALKING, 1);
  return (side < 0 ? -1 : 1) * turn * walking * walking;
}

function fillSamples(model, track, rows, count) {
  const samples = new Float64Array(count * COLUMNS);
  // Before and after the track, go on as it begins and ends, or stand if it stands there.
  for (let row = 0; row < count; row++) {
    const inside = Math.min(Math.max(row - PAD, 0), rows - 1);
    let beyond = row - PAD - inside;
    if (beyond !== 0 && stands(track[4 * inside + PHASE])) beyond = 0;
    for (let column = 0; column < 4; column++) {
      const here = track[4 * inside + column];
      let rate = 0;
      if (beyond < 0 && rows > 1) rate = track[4 * (inside + 1) + column] - here;
      else if (beyond > 0 && rows > 1) rate = here - track[4 * (inside - 1) + column];
      samples[row * COLUMNS + column] = here + beyond * rate;
    }
  }
  // Turn the hips towards the motion. The chest keeps its heading: the difference is the twist.
  for (let row = 0; row < count; row++) {
    const [x, y] = speeds(samples, row, count);
    const heading = samples[row * COLUMNS + HEADING];
    const c = Math.cos(heading), s = Math.sin(heading);
    samples[row * COLUMNS + TWIST] = hipTurn(c * x + s * y, c * y - s * x);
  }
  smooth(samples, TWIST, count);
  for (let row = 0; row < count; row++) samples[row * COLUMNS + HEADING] += samples[row * COLUMNS + TWIST];
  // Share of the clip's stride, of all movement and of that ahead.
  for (let row = 0; row < count; row++) {
    const [x, y, turn, quick] = speeds(samples, row, count);
    const rate = Math.max(quick, SLOWEST);
    const heading = samples[row * COLUMNS + HEADING];
    const c = Math.cos(heading), s = Math.sin(heading);
    const turning = TURN_STRIDE * turn;
    const stride = Math.sqrt(x * x + y * y + turning * turning) / rate;
    samples[row * COLUMNS + SHARE] = Math.min(stride / model.stride, LARGEST_SHARE);
    samples[row * COLUMNS + AHEAD] = Math.min(Math.max((c * x + s * y) / (rate * model.stride), 0), LARGEST_SHARE);
  }
  smooth(samples, SHARE, count);
  smooth(samples, AHEAD, count);
  return samples;
}

function lack(x, y, heading, side, apart) {
  const c = Math.cos(heading), s = Math.sin(heading);
  const along = Math.abs(c * x + s * y);
  const beside = Math.min(Math.max((LONG - along) / LONG_BY, 0), 1);
  return beside * Math.min(Math.max(apart - side * (c * y - s * x), 0), 2 * MOST_ASIDE);
}

const footOf = (half) => ((half % 2) + 2) % 2;

function pushApart(plan, bodies, most) {
  const { steps, rows, half } = plan;
  for (let row = 1; row < rows; row++) {
    const side = 1 - 2 * footOf(half + row);
    const i = row * STEP_COLUMNS, before = i - STEP_COLUMNS;
    const x = steps[i] - steps[before], y = steps[i + 1] - steps[before + 1];
    const apart = APART * Math.min(bodies[4 * row - 3], bodies[4 * row + 1]);
    let wanting = Math.max(lack(x, y, bodies[4 * row - 4], side, apart), lack(x, y, bodies[4 * row], side, apart));
    const heading = 0.5 * (bodies[4 * row - 4] + bodies[4 * row]);
    wanting = Math.max(wanting, apart - side * (Math.cos(heading) * y - Math.sin(heading) * x));
    const share = bodies[4 * row + 3] - bodies[4 * row - 1] > STOOD ? 1 : 0.5;
    bodies[4 * row + 2] = Math.min(share * wanting, most);
  }
  for (let row = 0; row < rows; row++) {
    const side = 1 - 2 * footOf(half + row);
    let push = row > 0 ? bodies[4 * row + 2] : 0;
    if (row + 1 < rows && bodies[4 * row + 7] - bodies[4 * row + 3] <= STOOD) push = Math.max(push, bodies[4 * row + 6]);
    steps[row * STEP_COLUMNS] -= side * push * Math.sin(bodies[4 * row]);
    steps[row * STEP_COLUMNS + 1] += side * push * Math.cos(bodies[4 * row]);
  }
}

function planPrints(model, plan) {
  const { steps, rows, half, samples, count } = plan;
  const bodies = new Float64Array(4 * rows);
  let span = 1;
  for (let row = 0; row < rows; row++) {
    const foot = footOf(half + row);
    const landing = timeOfValue(samples, COLUMNS, PHASE, 0.5 * (half + row), STEP, count, span);
    span = landing.span;
    const over = timeOfValue(samples, COLUMNS, PHASE, 0.5 * (half + row) + REFERENCE, STEP, count, span);
    const track = trackAt(plan, Math.min(over.time, landing.time + LONGEST_LOOK));
    const ahead = Math.min(track[AHEAD], 1);
    const side = 1 - 2 * foot;
    const width = (1 - ahead) * model.width + ahead * Math.abs(model.prints[3 * foot + 1]);
    const place = (1 - ahead) * 0.5 * model.bones[5 * foot + 2] + ahead * model.prints[3 * foot];
    const c = Math.cos(track[HEADING]), s = Math.sin(track[HEADING]);
    const i = row * STEP_COLUMNS;
    steps[i] = track[X] + c * place - side * s * width;
    steps[i + 1] = track[Y] + s * place + side * c * width;
    steps[i + 2] = track[HEADING] + model.prints[3 * foot + 2];
    bodies[4 * row] = track[HEADING];
    bodies[4 * row + 1] = width;
    bodies[4 * row + 3] = landing.time;
  }
  // Twice, as a foot that is moved may come near the one before it.
  pushApart(plan, bodies, MOST_ASIDE);
  pushApart(plan, bodies, 0.3 * MOST_ASIDE);
  // Swing out if the straight way to the next print would touch the other foot.
  for (let row = 1; row < rows - 1; row++) {
    const side = 1 - 2 * footOf(half + row + 1);
    const i = row * STEP_COLUMNS, old = i - STEP_COLUMNS, next = i + STEP_COLUMNS;
    let aside = 0;
    for (let k = 0; k < 3; k++) {
      const share = 0.25 + 0.25 * k;
      const x = (1 - share) * steps[old] + share * steps[next] - steps[i];
      const y = (1 - share) * steps[old + 1] + share * steps[next + 1] - steps[i + 1];
      const wanting = lack(x, y, steps[i + 2], side, PASSING);
      aside = Math.max(aside, wanting / (16 * share * share * (1 - share) * (1 - share)));
    }
    steps[old + ASIDE] = Math.min(aside, MOST_ASIDE);
  }
}

function planDrops(model, plan) {
  const { steps, rows, half, samples, count } = plan;
  let span = 1;
  for (let row = 0; row < rows; row++) {
    const foot = footOf(half + row), i = row * STEP_COLUMNS;
    let near = span;
    for (let k = 0; k < ASKED.length; k++) {
      const u = ASKED[k];
      const found = timeOfValue(samples, COLUMNS, PHASE, 0.5 * (half + row) + u, STEP, count, near);
      near = found.span;
      if (k === 0) span = near;
      const track = trackAt(plan, found.time);
      // Measure without any drop: the column already holds what earlier stances asked for.
      track[DROP] = 0;
      const { place, turn } = pelvisOf(model, track);
      const spare = HEEL_MOST * Math.min(Math.max((u - HEEL_FROM) / HEEL_BY, 0), 1);
      const { ankle } = standAnkle(model, foot, steps[i], steps[i + 1], steps[i + 2], u, track, place, turn, spare);
      const wanting = lacking(model.bones, foot, hipOf(model, foot, place, turn), ankle);
      if (wanting <= 0) continue;
      const middle = Math.floor(found.time / STEP);
      for (let sample = Math.max(middle - 3, 0); sample < Math.min(middle + 5, count); sample++) {
        const at = sample * COLUMNS + DROP;
        samples[at] = Math.max(samples[at], Math.min(wanting, DEEPEST));
      }
    }
  }
  smooth(samples, DROP, count);
}

function planSwings(model, plan) {
  const { steps, rows, half, samples, count } = plan;
  const little = 0.01;
  let span = 1;
  for (let row = 0; row < rows; row++) {
    const foot = footOf(half + row), i = row * STEP_COLUMNS;
    let near = span;
    for (let ends = 0; ends < 2; ends++) {
      const column = ends === 0 ? LAND : LIFT;
      for (let k = 0; k < 2; k++) {
        const u = ends === 0 ? k * little : STANCE - (1 - k) * little;
        const found = timeOfValue(samples, COLUMNS, PHASE, 0.5 * (half + row) + u, STEP, count, near);
        near = found.span;
        if (ends === 0 && k === 0) span = near;
        const track = trackAt(plan, found.time);
        const { place, turn } = pelvisOf(model, track);
        const foot3 = standAnkle(model, foot, steps[i], steps[i + 1], steps[i + 2], u, track, place, turn, -1);
        const outer = ends === 1 ? k : 1 - k;
        for (let axis = 0; axis < 3; axis++) {
          if (k === 0) steps[i + column + 5 + axis] = -foot3.ankle[axis] / little;
          else steps[i + column + 5 + axis] += foot3.ankle[axis] / little;
          if (outer === 1) steps[i + column + axis] = foot3.ankle[axis];
        }
        if (outer === 1) {
          steps[i + column + 3] = foot3.pitch;
          steps[i + column + 4] = foot3.yaw;
        }
      }
    }
  }
}
