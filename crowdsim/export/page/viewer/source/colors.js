// Colors of shirts: by behavior, group, speed, time of waiting, or level (captured or steered).

import { rgb } from "./place.js";
import { heat } from "./density.js";

export const COLORINGS = ["behavior", "group", "speed", "waiting", "level"];
const FASTEST = 1.6; // m/s
const LONGEST = 30; // seconds

const SPEEDS = [[59, 76, 160], [64, 150, 170], [110, 190, 110], [250, 215, 70]];

/** Color at a share (0 to 1) of the way along stops at even distances. */
function along(stops, share) {
  const place = Math.min(Math.max(share, 0), 1) * (stops.length - 1), k = Math.min(Math.floor(place), stops.length - 2);
  return stops[k].map((value, c) => Math.round(value + (place - k) * (stops[k + 1][c] - value)));
}

/** A color mixed with black, if the share is below 0, or with white. */
function shaded(color, share) {
  return color.map((value) => Math.round(value + share * (share > 0 ? 255 - value : value)));
}

/** A function from an agent to its color in a frame; builds: (stature, girth, shade of the shirt) of each agent. */
export function shirts(by, facts, source, frame, builds) {
  const behaviors = facts.behaviors.map(({ color }) => rgb(color));
  if (by === "group") return (agent) => shaded(facts.group_colors[facts.group_of[agent]], builds[3 * agent + 2]);
  if (by === "speed") return (agent) => along(SPEEDS, frame.speed[agent] / FASTEST);
  if (by === "waiting") return (agent) => heat(source.waitedUntil(agent, frame.time) / LONGEST);
  if (by === "level") {
    const levels = facts.locomotion_levels.map(({ color }) => rgb(color));
    return (agent) => levels[frame.steered[agent]];
  }
  return (agent) => shaded(behaviors[frame.behavior[agent]] ?? [150, 150, 150], builds[3 * agent + 2]);
}

/** Words and colors of a legend. */
export function legend(by, facts) {
  if (by === "group") return facts.groups.map((name, k) => [name, facts.group_colors[k]]);
  if (by === "speed") return [0, 0.5, 1, 1.5].map((speed) => [`${speed} m/s`, along(SPEEDS, speed / FASTEST)]);
  if (by === "waiting") return [0, 10, 20, 30].map((time) => [`${time}${time === 30 ? "+" : ""} s waited`, heat(time / LONGEST)]);
  if (by === "level") return facts.locomotion_levels.map(({ name, color }) => [name, rgb(color)]);
  return facts.behaviors.map(({ name, color }) => [name.replaceAll("_", " "), rgb(color)]);
}
