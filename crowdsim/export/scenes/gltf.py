"""Write recordings as binary glTF 2.0: animated bodies with skeletons, in their environment.

Meters, Y up, seconds from the first frame. Agents share one body and differ in materials; while an agent is
absent, its scale is 0. A body that crosses the ends of a periodic floor goes on beyond them until a millisecond before
its next frame, so that no viewer shows its way back.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.export.choice import Choice
from crowdsim.export.options import ExportOptions
from crowdsim.export.scenes.bodies import BodyMotion, body_motions, jumps
from crowdsim.export.scenes.glb_file import INDICES, VERTICES, GltfBuffer
from crowdsim.export.scenes.looks import VARIETY, body_of, bound_points, build_of, paints, tissue_triangles
from crowdsim.export.scenes.place import Paint, place_parts
from crowdsim.motion.clips.kinematics import rotate
from crowdsim.playback.bodies.bare_parts import sculpted_pose
from crowdsim.recording.reader import Recording
from crowdsim.version import __version__

_Z_UP = [-0.70710678, 0.0, 0.0, 0.70710678]
"""Rotation about x that turns our z axis into glTF's y axis, (x, y, z, w)."""

_FULL = 32767
"""Integer that stands for 1 in rotations of 16 bits."""
_INSTANT = 0.001
"""Time before a frame until which a body that crosses the end of a periodic floor goes on beyond it [s]."""


def write(recording: Recording, file: Path, choice: Choice, options: ExportOptions) -> None:
    """Write a scene with the environment and all chosen agents, and one animation."""
    scene = _Scene(recording, choice)
    for motion in body_motions(recording, choice):
        scene.add_character(motion)
    scene.write(file)


class _Scene:
    """The lists of a glTF document while it is being filled."""

    def __init__(self, recording: Recording, choice: Choice) -> None:
        self._recording, self._choice = recording, choice
        self._skeleton = recording.header.motion.skeleton
        self._buffer = GltfBuffer()
        # Node 0 is the root.
        self._nodes: list[dict[str, Any]] = [{"name": "crowdsim", "rotation": _Z_UP, "children": []}]
        self._meshes: list[dict[str, Any]] = []
        self._materials: list[dict[str, Any]] = []
        self._skins: list[dict[str, Any]] = []
        self._channels: list[dict[str, Any]] = []
        self._samplers: list[dict[str, Any]] = []
        # Numbers of the materials by color, and of the meshes of bodies by look.
        self._paints: dict[tuple[float, ...], int] = {}
        self._bodies: dict[int, int] = {}
        times = np.arange(len(choice.steps)) / choice.rate
        self._times = times.astype(np.float32)
        self._time_view = self._buffer.add_view(self._times) if len(times) else -1  # not used without frames
        self._looks = paints(VARIETY)
        self._add_place()
        self._add_body()

    def _add_node(self, parent: int | None, node: dict[str, Any]) -> int:
        """Append a node below ``parent``, or at the top; return its number."""
        self._nodes.append(node)
        number = len(self._nodes) - 1
        if parent is not None:
            self._nodes[parent].setdefault("children", []).append(number)
        return number

    def _material(self, paint: Paint) -> int:
        """Return the number of the material of a paint; equal paints share one."""
        key = (*paint.linear, paint.opacity)
        if key not in self._paints:
            color = {"baseColorFactor": [*key], "metallicFactor": 0, "roughnessFactor": 0.9}
            material: dict[str, Any] = {"name": paint.name, "pbrMetallicRoughness": color}
            if paint.opacity < 1.0:
                material |= {"alphaMode": "BLEND", "doubleSided": True}
            self._materials.append(material)
            self._paints[key] = len(self._materials) - 1
        return self._paints[key]

    def _add_place(self) -> None:
        """Add a mesh and a node for each part of the place, shown at its times."""
        add = self._buffer.add
        for part in place_parts(self._recording, self._choice):
            attributes = {"POSITION": add(part.points, VERTICES, bounds=True), "NORMAL": add(part.normals, VERTICES)}
            indices = add(part.triangles.reshape(-1), INDICES)
            primitive = {"attributes": attributes, "indices": indices, "material": self._material(part.paint)}
            self._meshes.append({"name": part.name, "primitives": [primitive]})
            node = self._add_node(0, {"name": part.name, "mesh": len(self._meshes) - 1})
            if part.shown is not None:
                self._show(node, part.shown)

    def _add_body(self) -> None:
        """Add what all agents share: vertices, triangles of each tissue, and the rest pose."""
        skeleton, add = self._skeleton, self._buffer.add
        body = body_of(skeleton)
        joints, weights = np.zeros((body.vertex_count, 4), np.uint8), np.zeros((body.vertex_count, 4), np.float32)
        joints[:, :2], weights[:, :2] = body.joints, body.weights
        joints[weights == 0.0] = 0  # glTF requires joint 0 for weight 0
        points, normals = bound_points(body, skeleton)
        self._points = [add(build, VERTICES, bounds=True) for build in points]
        self._attributes = {
            "NORMAL": add(normals, VERTICES),
            "JOINTS_0": add(joints, VERTICES),
            "WEIGHTS_0": add(weights, VERTICES),
        }
        self._tissues = [
            (tissue, add(triangles.reshape(-1).astype(np.uint16), INDICES))
            for tissue, triangles in tissue_triangles(body)
        ]
        positions, rotations = sculpted_pose(skeleton)
        binds = np.tile(np.eye(4, dtype=np.float32), (skeleton.joint_count, 1, 1))
        # Inverse of a joint's pose: from the space of the body to that of the joint. glTF stores matrices column by
        # column, so the last row here is the translation.
        axes = rotate(rotations[:, None], np.eye(3))
        binds[:, :3, :3] = axes.transpose(0, 2, 1)
        binds[:, 3, :3] = -(axes @ positions[:, :, None])[..., 0]
        self._binds = add(binds)
        self._offsets = np.round(skeleton.offsets, 7).tolist()

    def _body_mesh(self, look: int) -> int:
        """Return the number of the mesh of a body in a look; all share the points of their build."""
        if look not in self._bodies:
            primitives = [
                {
                    "attributes": {"POSITION": self._points[build_of(look)], **self._attributes},
                    "indices": indices,
                    "material": self._material(self._looks[look][tissue]),
                }
                for tissue, indices in self._tissues
            ]
            self._meshes.append({"name": f"body {look}", "primitives": primitives})
            self._bodies[look] = len(self._meshes) - 1
        return self._bodies[look]

    def add_character(self, motion: BodyMotion) -> None:
        """Add an agent with its skeleton, skin and motion; agents with the same look share a mesh."""
        skeleton, agent = self._skeleton, motion.agent
        # Quaternions as (x, y, z, w). Joints that never turn get a rotation of their node instead of an animation.
        packed = np.rint(motion.rotations[..., [1, 2, 3, 0]] * _FULL).astype(np.int16)
        still = (packed == packed[:1]).all(axis=(0, 2))
        group = self._recording.header.agents.groups[agent]
        extras = {"agent": agent, "group": group}
        top = self._add_node(0, {"name": f"character {agent}", "extras": extras})
        first = len(self._nodes)
        for joint, parent in enumerate(skeleton.parents.tolist()):
            node: dict[str, Any] = {"name": skeleton.names[joint]}
            if parent >= 0:
                node["translation"] = self._offsets[joint]
            if still[joint]:
                turn = packed[0, joint].astype(np.float64)
                node["rotation"] = np.round(turn / np.sqrt(np.sum(turn * turn)), 7).tolist()
            self._add_node(top if parent < 0 else first + parent, node)
        joints = list(range(first, first + skeleton.joint_count))
        self._skins.append({"joints": joints, "inverseBindMatrices": self._binds, "skeleton": first})
        mesh = self._body_mesh(agent % VARIETY)
        self._add_node(None, {"name": f"body of {agent}", "mesh": mesh, "skin": len(self._skins) - 1})

        turning = np.flatnonzero(~still)
        times = self._time_accessor(motion.frames)
        columns = np.ascontiguousarray(packed[:, turning].transpose(1, 0, 2))
        view = self._buffer.add_view(columns) if len(turning) else -1  # not used if no joint turns
        for place, joint in enumerate(turning.tolist()):
            values = self._buffer.add_accessor(view, columns[place], place * columns[place].nbytes, normalized=True)
            self._animate(first + joint, "rotation", times, values)
        self._move(first, motion, times)
        self._show(top, motion.shown(len(self._times)))

    def _move(self, node: int, motion: BodyMotion, times: int) -> None:
        """Animate the position of the root joint, which is ``node``.

        ``times`` is the accessor of the times of the motion's frames.
        """
        roots = motion.roots
        leaps = jumps(self._recording, roots)
        if leaps:
            # Shortly before the first frame after a crossing, add a sample with the position beyond the end.
            seconds = self._times[motion.frames]
            rows = np.array([leap.row for leap in leaps])
            roots = np.insert(roots, rows, np.stack([leap.beyond for leap in leaps]), axis=0)
            before = (seconds[rows].astype(np.float64) - _INSTANT).astype(np.float32)
            # After some hours, float32 does not resolve an instant, and no two samples may have the same time.
            before = np.minimum(before, np.nextafter(seconds[rows], np.float32(0.0)))
            times = self._buffer.add(np.insert(seconds, rows, before), bounds=True)
        self._animate(node, "translation", times, self._buffer.add(roots))

    def _time_accessor(self, frames: NDArray[np.int64]) -> int:
        """Return the accessor of the times of ``frames`` (k,); consecutive frames need no times of their own."""
        first, count = int(frames[0]), len(frames)
        times = self._times[frames]
        if frames[-1] - first + 1 != count:
            return self._buffer.add(times, bounds=True)
        return self._buffer.add_accessor(self._time_view, times, 4 * first, bounds=True)  # 4 bytes a time

    def _animate(self, node: int, path: str, times: int, values: int, interpolation: str = "LINEAR") -> None:
        """Animate the property ``path`` of a node; ``times`` and ``values`` are accessors."""
        self._samplers.append({"input": times, "output": values, "interpolation": interpolation})
        self._channels.append({"sampler": len(self._samplers) - 1, "target": {"node": node, "path": path}})

    def _show(self, node: int, shown: tuple[int, ...]) -> None:
        """Animate the scale of a node: 1 from the frames at which it appears, 0 from those at which it disappears.

        ``shown`` holds these frames in turn. A node that is there all the time needs no animation.
        """
        if shown == (0,):
            return
        # A node that appears later has scale 0 from the first frame on.
        frames = np.array(shown if shown[0] == 0 else (0, *shown))
        sizes = (np.arange(len(frames)) % 2 == (0 if shown[0] == 0 else 1)).astype(np.float32)
        scales = self._buffer.add(np.repeat(sizes, 3).reshape(-1, 3))
        self._animate(node, "scale", self._buffer.add(self._times[frames], bounds=True), scales, "STEP")

    def write(self, file: Path) -> None:
        """Write the document."""
        choice, recording = self._choice, self._recording
        roots = [0, *(number for number, node in enumerate(self._nodes) if "skin" in node)]
        start = float(choice.steps[0]) / recording.steps_per_second if len(choice.steps) else 0.0
        extras = {"scenario": recording.header.scenario_name, "seed": recording.header.seed, "start": start}
        extras |= {"rate": choice.rate}
        animation = {"name": "walk", "channels": self._channels, "samplers": self._samplers}
        self._buffer.write(
            file,
            {
                "asset": {"version": "2.0", "generator": f"crowdsim {__version__}", "extras": extras},
                "scene": 0,
                "scenes": [{"nodes": roots}],
                "nodes": self._nodes,
                "meshes": self._meshes,
                "materials": self._materials,
                "skins": self._skins,
                "animations": [animation] if self._channels else [],
            },
        )
