"""Behaviors with their clips: read, measured, and joined into one motion graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowdsim.library import library_folder
from crowdsim.motion.bvh_reader import read_bvh
from crowdsim.motion.clearance import measure_clearances
from crowdsim.motion.motion_graph import MotionGraph, MotionSource, build_motion_graph
from crowdsim.planning.behaviors import Behavior, read_behavior


@dataclass(frozen=True)
class BehaviorSet:
    behaviors: tuple[Behavior, ...]
    graph: MotionGraph


def load_behavior_set(names: Sequence[str], bands, folder: Path | None = None, captures=None, capture_clips=()):
    lib = folder or library_folder("behaviors")
    files = {n: read_behavior(n, lib) for n in names}
    behaviors = []
    heights = [(0.1, 0.6), *[(b.low, b.high) for b in bands[1:]]]
    clips = {}
    for n, f in files.items():
        radii = np.zeros(len(bands))
        for c in f.clips:
            clips[n, c.file] = read_bvh(lib / n / c.file)
            if "sharp" in c.file or "turn_" in c.file or "turning" in c.file:
                continue
            radii = np.maximum(radii, measure_clearances(clips[n, c.file], heights, np.radians(f.facing[0])))
        behaviors.append(f.behavior(radii, lib / n))
    behaviors.sort(key=lambda b: b.radii[1])
    legs = max(b.radii[0] for b in behaviors)
    index = {b.name: i for i, b in enumerate(behaviors)}
    sources = []
    for b in behaviors:
        f = files[b.name]
        i = index[b.name]
        for c in f.clips:
            sources.append(MotionSource(clips[b.name, c.file], i, tuple(f.detectors)))
        for c in f.idle:
            sources.append(MotionSource(read_bvh(lib / b.name / c.file), i, tuple(f.detectors), idle=True))
        for t in f.transitions:
            if t.from_ in index and t.to in index and "standing" not in t.file:
                d = tuple(dict.fromkeys([*files[t.from_].detectors, *files[t.to].detectors]))
                sources.append(MotionSource(read_bvh(lib / b.name / t.file), max(index[t.from_], index[t.to]), d))
    print([(b.name, b.radii) for b in behaviors])
    return BehaviorSet(tuple(behaviors), build_motion_graph(sources))
