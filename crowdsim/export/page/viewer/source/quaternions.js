// Rotations (w, x, y, z) in plain arrays, at an offset.

/** out[o..] = a[i..] * b[j..]: the rotation b, then a. Any of them may be the same. */
export function multiply(out, o, a, i, b, j) {
  const a0 = a[i], a1 = a[i + 1], a2 = a[i + 2], a3 = a[i + 3];
  const b0 = b[j], b1 = b[j + 1], b2 = b[j + 2], b3 = b[j + 3];
  out[o] = a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3;
  out[o + 1] = a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2;
  out[o + 2] = a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1;
  out[o + 3] = a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0;
}

/** Product of two rotations as a new array. */
export function product(a, b) {
  const out = [0, 0, 0, 0];
  multiply(out, 0, a, 0, b, 0);
  return out;
}

export const conjugate = (a) => [a[0], -a[1], -a[2], -a[3]];

/** A vector turned by a rotation. */
export function rotate(q, x, y, z) {
  const tx = 2 * (q[2] * z - q[3] * y);
  const ty = 2 * (q[3] * x - q[1] * z);
  const tz = 2 * (q[1] * y - q[2] * x);
  return [
    x + q[0] * tx + q[2] * tz - q[3] * ty,
    y + q[0] * ty + q[3] * tx - q[1] * tz,
    z + q[0] * tz + q[1] * ty - q[2] * tx,
  ];
}

/** out[o..] = the share w of the rotation d, the shorter way round, times q[i..]. */
export function partThen(out, o, d, k, w, q, i) {
  const sine = Math.hypot(d[k + 1], d[k + 2], d[k + 3]);
  if (sine < 1e-7) {
    for (let c = 0; c < 4; c++) out[o + c] = q[i + c];
    return;
  }
  const half = w * Math.atan2(sine, Math.abs(d[k]));
  const scale = Math.sin(half) / (d[k] < 0 ? -sine : sine);
  multiply(out, o, [Math.cos(half), scale * d[k + 1], scale * d[k + 2], scale * d[k + 3]], 0, q, i);
}

/** out[o..] = the rotation that turns b[j..] into a[i..]: a times the inverse of b. */
export function difference(out, o, a, i, b, j) {
  multiply(out, o, a, i, [b[j], -b[j + 1], -b[j + 2], -b[j + 3]], 0);
}

/** An angle in (-pi, pi]. */
export function wrapAngle(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}
