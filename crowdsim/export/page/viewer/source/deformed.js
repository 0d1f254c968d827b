// Poses of deformed clips: crowdsim/motion/deformed/pose_kernels.py in JavaScript.

import {
  AHEAD, HEEL_BACK, PHASE, REACH, SHARE, STANCE, TWIST,
  ease, hipOf, lacking, pelvisOf, plannedPitch, sampled, standAnkle, trackAt, turnedBy,
} from "./body_parts.js";
import { ASIDE, LAND, LIFT, PAD, STEP_COLUMNS } from "./footsteps.js";
import { conjugate, product, rotate } from "./quaternions.js";

const LEAST_LIFT = 0.045; // meters by which a foot is lifted in a step on the spot
const CLEAR = 0.015; // meters between sole and floor in the middle of a swing, at least

/** Cubic curve at u (0 to 1) from `start` to `end`, with the speeds there [per unit of u]. */
function cubic(u, start, startSpeed, end, endSpeed) {
  const rest = 1 - u;
  return (1 + 2 * u) * rest * rest * start + u * u * (1 + 2 * rest) * end
    + u * rest * (rest * startSpeed - u * endSpeed);
}

/** Ankle, pitch and yaw of a swinging foot at share u of its cycle, between the rows `old` and `next` of `steps`. */
function swingAnkle(model, foot, steps, old, next, u, track) {
  const length = 1 - STANCE, v = (u - STANCE) / length, rest = 1 - v;
  const at = [0, 1, 2].map((axis) => cubic(
    v, steps[old + LIFT + axis], length * steps[old + LIFT + 5 + axis],
    steps[next + LAND + axis], length * steps[next + LAND + 5 + axis],
  ));
  const yaw = steps[old + LIFT + 4] + ease(v) * (steps[next + LAND + 4] - steps[old + LIFT + 4]);
  const bulge = 16 * v * v * rest * rest;
  // Pass the other foot at a distance.
  const aside = (1 - 2 * foot) * steps[old + ASIDE] * bulge;
  const x = at[0] - aside * Math.sin(yaw), y = at[1] + aside * Math.cos(yaw);
  // Lift as the clip does, by the share of its stride; the less the body goes ahead, the more as in a step on the spot.
  const ahead = track[AHEAD], share = Math.min(track[SHARE], 1);
  let z = at[2] + ahead * sampled(model.lift, model.shapes.lift[1], foot, u);
  z += (1 - ahead / (ahead + 0.2)) * LEAST_LIFT * bulge * (0.6 + 0.4 * share);
  let pitch = plannedPitch(model, foot, u, ahead);
  pitch += (1 - ease(v)) * (steps[old + LIFT + 3] - plannedPitch(model, foot, STANCE, ahead));
  // Keep the sole off the floor.
  const pc = Math.cos(pitch), ps = Math.sin(pitch), high = model.bones[5 * foot + 3];
  const ball = model.bones[5 * foot + 2] * ps - high * pc, heel = -HEEL_BACK * ps - high * pc;
  z = Math.max(z, CLEAR * 4 * v * rest - Math.min(ball, heel));
  return { ankle: [x, y, z], pitch, yaw };
}

/** Ankle, pitch and yaw of a foot at share u of its cycle; `row` is that of its step. */
function footAt(model, plan, row, foot, u, track, place, turn) {
  const i = row * STEP_COLUMNS, steps = plan.steps;
  if (u < STANCE) {
    return standAnkle(model, foot, steps[i], steps[i + 1], steps[i + 2], u, track, place, turn, -1);
  }
  return swingAnkle(model, foot, steps, i, i + 2 * STEP_COLUMNS, u, track);
}

/** Quaternion of the rotation whose matrix has the columns x, y and z. */
function frameRotation(x0, x1, x2, y0, y1, y2, z0, z1, z2) {
  let w, i, j, k;
  if (x0 + y1 + z2 > 0) [w, i, j, k] = [1 + x0 + y1 + z2, y2 - z1, z0 - x2, x1 - y0];
  else if (x0 >= y1 && x0 >= z2) [w, i, j, k] = [y2 - z1, 1 + x0 - y1 - z2, y0 + x1, z0 + x2];
  else if (y1 >= z2) [w, i, j, k] = [z0 - x2, y0 + x1, 1 + y1 - x0 - z2, z1 + y2];
  else [w, i, j, k] = [x1 - y0, z0 + x2, z1 + y2, 1 + z2 - x0 - y1];
  const n = 1 / Math.sqrt(w * w + i * i + j * j + k * k);
  return [w * n, i * n, j * n, k * n];
}

function put(out, joint, q) {
  for (let c = 0; c < 4; c++) out[4 * joint + c] = q[c];
}

const turnOf = (model, foot, row) => {
  const i = 20 * foot + 4 * row;
  return [model.turns[i], model.turns[i + 1], model.turns[i + 2], model.turns[i + 3]];
};

/** Local rotations of a leg from its hip to a target (ankle, pitch, yaw) into `out`; its knee points `forward` (x, y). */
function poseLeg(model, foot, hip, turn, target, forward, out) {
  const { ankle, pitch, yaw } = target;
  const thigh = model.bones[5 * foot], shank = model.bones[5 * foot + 1];
  let x = ankle[0] - hip[0], y = ankle[1] - hip[1], z = ankle[2] - hip[2];
  const far = Math.sqrt(x * x + y * y + z * z);
  const reach = Math.min(far, REACH * (thigh + shank));
  x /= far; y /= far; z /= far;
  // The hinge of the knee lies across the way ahead and the way down; it points to the left.
  let hx = forward[1] * z, hy = -forward[0] * z, hz = forward[0] * y - forward[1] * x;
  let n = 1 / Math.sqrt(Math.max(hx * hx + hy * hy + hz * hz, 1e-12));
  hx *= n; hy *= n; hz *= n;
  const fx = hy * -z - hz * -y, fy = hz * -x - hx * -z, fz = hx * -y - hy * -x;
  const cosine = (thigh * thigh + reach * reach - shank * shank) / (2 * thigh * reach);
  const sine = Math.sqrt(Math.max(1 - cosine * cosine, 0));
  const tx = cosine * x + sine * fx, ty = cosine * y + sine * fy, tz = cosine * z + sine * fz;
  let kx = (reach * x - thigh * tx) / shank, ky = (reach * y - thigh * ty) / shank;
  let kz = (reach * z - thigh * tz) / shank;
  n = 1 / Math.sqrt(kx * kx + ky * ky + kz * kz);
  kx *= n; ky *= n; kz *= n;
  // Each bone: z up it, y the hinge, x across both.
  const upper = frameRotation(hz * ty - hy * tz, hx * tz - hz * tx, hy * tx - hx * ty, hx, hy, hz, -tx, -ty, -tz);
  const lower = frameRotation(hz * ky - hy * kz, hx * kz - hz * kx, hy * kx - hx * ky, hx, hy, hz, -kx, -ky, -kz);
  const thighWorld = product(upper, turnOf(model, foot, 1));
  const shankWorld = product(lower, turnOf(model, foot, 2));
  const level = product(
    [Math.cos(0.5 * yaw), 0, 0, Math.sin(0.5 * yaw)], [Math.cos(0.5 * pitch), 0, -Math.sin(0.5 * pitch), 0],
  );
  const footWorld = product(level, turnOf(model, foot, 3));
  const legs = model.legs;
  put(out, legs[4 * foot], product(conjugate(product(turn, turnOf(model, foot, 0))), thighWorld));
  put(out, legs[4 * foot + 1], product(conjugate(thighWorld), shankWorld));
  put(out, legs[4 * foot + 2], product(conjugate(shankWorld), footWorld));
  if (legs[4 * foot + 3] < 0) return;
  // The toes stay level while the foot points down, or their tips would go through the floor.
  const bend = Math.max(-pitch, 0);
  const toe = product(level, [Math.cos(0.5 * bend), 0, -Math.sin(0.5 * bend), 0]);
  put(out, legs[4 * foot + 3], product(conjugate(footWorld), product(toe, turnOf(model, foot, 4))));
}

/** Local rotations of the joints above the legs into `out`. */
export function poseUpper(model, track, out) {
  const phase = track[PHASE], share = track[SHARE], upper = model.upper, count = upper.length;
  const samples = model.shapes.swings[0] - 1, swings = model.swings, mean = model.mean;
  const at = (phase - Math.floor(phase)) * samples;
  const k = Math.min(Math.floor(at), samples - 1);
  const late = share * (at - k), early = share - late;
  const half = (0.5 * track[TWIST]) / Math.max(model.spine, 1);
  const back = [Math.cos(half), 0, 0, -Math.sin(half)];
  for (let u = 0; u < count; u++) {
    const a = 3 * (k * count + u), b = a + 3 * count;
    const swing = turnedBy(
      early * swings[a] + late * swings[b],
      early * swings[a + 1] + late * swings[b + 1],
      early * swings[a + 2] + late * swings[b + 2],
    );
    const joint = upper[u], m = 4 * joint;
    let turn = product([mean[m], mean[m + 1], mean[m + 2], mean[m + 3]], swing);
    if (u < model.spine) turn = product(back, turn);
    put(out, joint, turn);
  }
}

/** Pose of a planned body, seconds after its first sample: its root into `root` (3), local rotations into `out`. */
export function poseBody(model, plan, time, root, out) {
  const track = trackAt(plan, time + PAD * plan.step);
  const { place, turn } = pelvisOf(model, track);
  const phase = track[PHASE], whole = Math.floor(phase);
  const left = footAt(model, plan, 2 * whole - plan.half, 0, phase - whole, track, place, turn);
  const late = phase - 0.5, behind = Math.floor(late);
  const right = footAt(model, plan, 2 * behind + 1 - plan.half, 1, late - behind, track, place, turn);
  // If a standing leg does not reach its foot in any other way, lower the pelvis.
  let lack = 0;
  if (phase - whole < STANCE) lack = Math.max(lack, lacking(model.bones, 0, hipOf(model, 0, place, turn), left.ankle));
  if (late - behind < STANCE) lack = Math.max(lack, lacking(model.bones, 1, hipOf(model, 1, place, turn), right.ankle));
  place[2] -= lack;
  for (let axis = 0; axis < 3; axis++) root[axis] = place[axis];
  put(out, 0, turn);
  // Knees point between the foot and the pelvis.
  const front = rotate(turn, 1, 0, 0);
  const across = 1 / Math.sqrt(front[0] * front[0] + front[1] * front[1]);
  for (const [foot, target] of [[0, left], [1, right]]) {
    const x = Math.cos(target.yaw) + front[0] * across, y = Math.sin(target.yaw) + front[1] * across;
    const n = 1 / Math.sqrt(Math.max(x * x + y * y, 1e-12));
    poseLeg(model, foot, hipOf(model, foot, place, turn), turn, target, [x * n, y * n], out);
  }
  poseUpper(model, track, out);
  return track;
}
