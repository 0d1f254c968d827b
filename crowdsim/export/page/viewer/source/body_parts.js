// A deformed body in parts: crowdsim/motion/deformed/body_kernels.py in JavaScript. Lengths in meters, angles in radians.

import { rotate, product } from "./quaternions.js";
import { spanOf, valueAt } from "./splines.js";

// Columns of the samples of a track.
export const X = 0, Y = 1, HEADING = 2, PHASE = 3, SHARE = 4, AHEAD = 5, DROP = 6, TWIST = 7, COLUMNS = 8;

export const STANCE = 0.6; // share of a foot's cycle in which it stands
export const HEEL_BACK = 0.055; // from the ankle back to the end of the heel
export const REACH = 0.9965; // share of its length to which a leg stretches at most
export const SOLE_DOWN = 0.125; // phase after landing at which the whole sole is on the floor

const FREE = 0.15;
const STEEPEST = 1.25;
const TWISTED = 0.5, EASE = 0.2;

const span = { span: 0, w0: 0, w1: 0, w2: 0, w3: 0 };

/** From 0 to 1 with no speed and no acceleration at the ends. */
export function ease(u) {
  const v = Math.min(Math.max(u, 0), 1);
  return v * v * v * (10 + v * (6 * v - 15));
}

/** All columns of a planned track at a time. */
export function trackAt(plan, time, out = new Float64Array(COLUMNS)) {
  spanOf(span, time, plan.step, plan.count);
  for (let column = 0; column < COLUMNS; column++) out[column] = valueAt(plan.samples, COLUMNS, column, span);
  return out;
}

/** Rotation of a half rotation vector. */
export function turnedBy(x, y, z) {
  const square = x * x + y * y + z * z;
  let c = square / 40320 - 1 / 720;
  c = ((c * square + 1 / 24) * square - 0.5) * square + 1;
  let s = square / 362880 - 1 / 5040;
  s = ((s * square + 1 / 120) * square - 1 / 6) * square + 1;
  const norm = 1 / Math.sqrt(c * c + s * s * square);
  return [c * norm, s * x * norm, s * y * norm, s * z * norm];
}

/** Place and rotation of the root on a track. */
export function pelvisOf(model, track) {
  const share = track[SHARE], waves = model.waves, columns = model.shapes.waves[1];
  const angle = 2 * Math.PI * (track[PHASE] - Math.floor(track[PHASE]));
  const c1 = Math.cos(angle), s1 = Math.sin(angle);
  const sums = [0, 0, 0, 0, 0, 0];
  let c = c1, s = s1;
  for (let k = 0; k < columns; k += 2) {
    for (let d = 0; d < 6; d++) sums[d] += waves[d * columns + k] * c + waves[d * columns + k + 1] * s;
    [c, s] = [c * c1 - s * s1, s * c1 + c * s1];
  }
  const walking = Math.min(share, 1);
  const ahead = model.root[0] + share * sums[0];
  const left = model.root[1] + share * sums[1];
  const height = (1 - walking) * model.stand + walking * model.root[2] + share * share * sums[2] - track[DROP];
  const hc = Math.cos(0.5 * track[HEADING]), hs = Math.sin(0.5 * track[HEADING]);
  c = hc * hc - hs * hs;
  s = 2 * hc * hs;
  const swung = product(model.mean, turnedBy(share * sums[3], share * sums[4], share * sums[5]));
  const place = [track[X] + c * ahead - s * left, track[Y] + s * ahead + c * left, height];
  return { place, turn: product([hc, 0, 0, hs], swung) };
}

/** Hip joint of a leg. */
export function hipOf(model, foot, place, turn) {
  const moved = rotate(turn, model.hips[3 * foot], model.hips[3 * foot + 1], model.hips[3 * foot + 2]);
  return [place[0] + moved[0], place[1] + moved[1], place[2] + moved[2]];
}

/** Row `foot` of samples over a cycle, at its share u. */
export function sampled(rows, columns, foot, u) {
  const last = columns - 1;
  const place = Math.min(Math.max(u, 0), 1) * last;
  const k = Math.min(Math.floor(place), last - 1);
  const i = foot * columns + k;
  return rows[i] + (place - k) * (rows[i + 1] - rows[i]);
}

/** Pitch of a foot as the clip's, by the share of its stride that the body goes ahead. */
export function plannedPitch(model, foot, u, ahead) {
  return sampled(model.pitch, model.shapes.pitch[1], foot, u) * ahead;
}

function standingYaw(printYaw, out, heading, u) {
  const twist = heading + out - printYaw;
  const beyond = Math.abs(twist) - TWISTED;
  if (beyond <= 0) return printYaw;
  const free = ease((u - SOLE_DOWN) / FREE);
  return printYaw + Math.sign(twist) * ((free * beyond * beyond) / (beyond + EASE));
}

function ankleOver(bones, b, pitch) {
  const length = bones[b + 2], high = bones[b + 3];
  const c = Math.cos(pitch), s = Math.sin(pitch);
  if (pitch > 0) return [HEEL_BACK * (c - 1) - high * s - length, HEEL_BACK * s + high * c];
  const rise = high - bones[b + 4];
  return [-length * c - rise * s, -length * s + rise * c + bones[b + 4]];
}

function reachingPitch(bones, b, pitch, hip, ballX, ballY, c, s) {
  const most = REACH * (bones[b] + bones[b + 1]);
  const x = c * (hip[0] - ballX) + s * (hip[1] - ballY);
  const y = c * (hip[1] - ballY) - s * (hip[0] - ballX);
  const [ahead, up] = ankleOver(bones, b, pitch);
  const dz = hip[2] - up;
  if ((x - ahead) * (x - ahead) + y * y + dz * dz <= most * most) return pitch;
  const z = hip[2] - bones[b + 4];
  const length = bones[b + 2], rise = bones[b + 3] - bones[b + 4];
  const radius = Math.sqrt(length * length + rise * rise);
  const flat = Math.sqrt(x * x + z * z);
  const share = (x * x + y * y + z * z + radius * radius - most * most) / (2 * radius * flat);
  const angle = Math.atan2(z, x) + Math.acos(Math.min(Math.max(share, -1), 1));
  return Math.max(Math.min(pitch, angle - Math.atan2(rise, -length)), -STEEPEST);
}

/** Meters by which the pelvis must come down for a leg to reach its ankle. */
export function lacking(bones, foot, hip, ankle) {
  const most = REACH * (bones[5 * foot] + bones[5 * foot + 1]);
  const x = hip[0] - ankle[0], y = hip[1] - ankle[1];
  return hip[2] - ankle[2] - Math.sqrt(Math.max(most * most - x * x - y * y, 0.01));
}

/** Ankle of a foot that stands on a print (x, y, heading); `spare` as in plan_kernels.py. */
export function standAnkle(model, foot, printX, printY, printYaw, u, track, place, turn, spare) {
  const yaw = standingYaw(printYaw, model.prints[3 * foot + 2], track[HEADING], u);
  const c = Math.cos(yaw), s = Math.sin(yaw);
  let pitch = plannedPitch(model, foot, u, track[AHEAD]);
  if (spare >= 0) {
    if (spare > 0) pitch = Math.min(pitch, -spare);
  } else if (u > SOLE_DOWN) {
    pitch = reachingPitch(model.bones, 5 * foot, pitch, hipOf(model, foot, place, turn), printX, printY, c, s);
  }
  const [ahead, up] = ankleOver(model.bones, 5 * foot, pitch);
  return { ankle: [printX + c * ahead, printY + s * ahead, up], pitch, yaw };
}
