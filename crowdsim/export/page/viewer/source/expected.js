// What a page expects of steered people: see crowdsim/export/page/tracks/expected_kernels.py.

const BOTH_FEET = 0.1, REFERENCE = 0.26, STAND = 0.06; // of a cycle

/** The angle of a vector, within 1e-5: with the same bits everywhere, which Math.atan2 need not give. */
export function direction(x, y) {
  const a = Math.abs(x), b = Math.abs(y);
  if (a === 0 && b === 0) return 0;
  const z = Math.min(a, b) / Math.max(a, b), s = z * z;
  let angle = z * (0.999866 + s * (-0.3302995 + s * (0.180141 + s * (-0.085133 + s * 0.0208351))));
  if (b > a) angle = 0.5 * Math.PI - angle;
  if (x < 0) angle = Math.PI - angle;
  return y < 0 ? -angle : angle;
}

/** The remainder of a value after division by `whole`, never below 0. */
export function rest(value, whole) {
  value %= whole;
  return value < 0 ? value + whole : value;
}

/** An integer angle between minus half a turn and half a turn. */
export function wrapped(value, turn) {
  const half = Math.floor(turn / 2);
  return rest(value + half, turn) - half;
}

/** The next phase, from a phase on, at which a body comes to a stand. */
export function nextStand(phase, cycle) {
  const half = Math.floor(cycle / 2), stand = Math.floor(STAND * cycle + 0.5), past = rest(phase, half);
  return phase - past + (past <= stand ? stand : half + stand);
}

/** Whether a body passes over its standing foot between two phases. */
export function passes(before, after, cycle) {
  const over = 2 * Math.floor(REFERENCE * cycle + 0.5);
  return Math.floor((2 * before - over) / cycle) < Math.floor((2 * after - over) / cycle);
}

/** Cycles a second of a steady walk, and what gives them: see `cadence`. */
function cadence(speed, angle, turn, out) {
  const off = Math.abs(angle), follows = Math.min(speed / 0.4, 1);
  const hip = off >= 1.4 ? 0 : Math.min(off, 1.4 - off);
  const left = off - hip * follows * follows, s = left * left;
  let c = 1 - s * (0.5 - s * (1 / 24 - s * (1 / 720 - s * (1 / 40320 - s / 3628800))));
  c = Math.min(Math.max(c, -1), 1);
  const along = speed * Math.abs(c), across = speed * Math.sqrt(1 - c * c);
  let rate = Math.sqrt(0.39 * along) / 0.78;
  if (c < 0) rate *= 1.35;
  rate = Math.max(rate, speed / 1.6);
  const aside = Math.min(0.5 * Math.min(1, across / 0.1) + 1.1 * across, 1.7), turning = Math.abs(turn);
  const onSpot = Math.min(0.35 * Math.min(1, turning / 0.2) + 0.4 * turning, 1.5);
  out.kind = onSpot > Math.max(rate, aside) ? 2 : aside > rate ? 1 : 0;
  return Math.max(rate, aside, onSpot);
}

/**
 * The phase after a step of a body into `out`: phase, and kind, the rule that gives it.
 * speed [m/s] and direction `ahead` of the step; heading, headingBefore: after and before it; left: heading of the body
 * when it was over the foot that is now behind, from where it is `away` [m]; angles in units of turn; units: turn, rate,
 * cycle.
 */
export function expectedPhase(phase, speed, ahead, heading, headingBefore, away, left, units, out) {
  const { turn, rate, cycle } = units, radians = (value) => (wrapped(value, turn) * (2 * Math.PI)) / turn;
  const turned = Math.abs(radians(heading - left)), half = Math.floor(cycle / 2);
  const past = rest(phase, half), passed = past / cycle, stand = phase - past + Math.floor(STAND * cycle + 0.5);
  if (speed < 0.35 && passed <= BOTH_FEET && away < 0.06 && turned < 0.25) {
    out.kind = 3;
    out.phase = Math.max(phase, Math.min(stand, phase + Math.floor((0.75 / rate) * cycle + 0.5)));
    return;
  }
  let steady = cadence(speed, radians(ahead - heading), radians(heading - headingBefore) * rate, out);
  if (steady < 0.45) {
    steady = speed > 0.1 ? 0.6 : 0.75;
    out.kind = 4;
  } else if (passed < REFERENCE && away * steady < 0.5 * (passed + 0.5 - REFERENCE) * speed) {
    steady = Math.max(steady, Math.min(6 * speed, 1.5));
    out.kind = 5;
  }
  out.phase = phase + Math.floor((steady / rate) * cycle + 0.5);
  if (out.phase > stand + half && steady <= 0.75 && speed <= 0.1) {
    out.phase = stand + half;
    out.kind = 6;
  }
}
