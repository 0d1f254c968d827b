"""Write recordings as binary USD: bodies with skeletons (UsdSkel) or capsules (a point instancer).

Meters, z up. A time code is a frame, the first one 0. All agents inherit one body and differ in materials.
"""

from __future__ import annotations

import errno
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError
from crowdsim.export.choice import Choice
from crowdsim.export.options import ExportOptions
from crowdsim.export.scenes.bodies import BodyMotion, body_motions, jumps, unwrapped
from crowdsim.export.scenes.looks import VARIETY, body_of, bound_points, build_of, paints, tissue_triangles
from crowdsim.export.scenes.place import Paint, place_parts
from crowdsim.motion.clips.skeleton import Skeleton
from crowdsim.playback.bodies.bare_parts import sculpted_pose
from crowdsim.recording.header import AgentState
from crowdsim.recording.reader import Recording

_INSTANT = 0.001
"""Time before a frame at which agents that leave, or cross an end of a periodic floor, are still shown [s]."""

_STILL = 1e-6
"""Change of a quaternion below which a joint counts as not turning."""

_CAPSULE_HEIGHT = 1.75
_CAPSULE_RADIUS = 0.22
"""Size of the capsules that stand for bodies [m]."""


def write(recording: Recording, file: Path, choice: Choice, options: ExportOptions) -> None:
    """Write a stage with the environment and all chosen agents.

    Raise CrowdSimError without usd-core, or for a name that does not end in .usdc.
    """
    try:
        import pxr  # noqa: F401
    except ImportError:
        raise CrowdSimError("USD needs usd-core; install it with: pip install 'crowdsim[usd]'") from None
    if file.suffix.lower() != ".usdc":
        raise CrowdSimError("binary USD is known by its ending; choose a name that ends in .usdc")
    stage = _Stage(recording, choice)
    if options.points:
        stage.add_points()
    else:
        stage.add_bodies()
    stage.write(file)


class _Stage:
    """A stage while it is being filled. USD's modules are members, because they are imported only here."""

    def __init__(self, recording: Recording, choice: Choice) -> None:
        from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt

        self._gf, self._sdf, self._geom, self._shade, self._skel, self._vt = Gf, Sdf, UsdGeom, UsdShade, UsdSkel, Vt
        self._recording, self._choice = recording, choice
        self._layer = Sdf.Layer.CreateAnonymous(".usdc")
        self._stage = Usd.Stage.Open(self._layer)
        UsdGeom.SetStageUpAxis(self._stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(self._stage, 1.0)
        self._stage.SetTimeCodesPerSecond(choice.rate)
        self._stage.SetFramesPerSecond(choice.rate)
        self._stage.SetStartTimeCode(0)
        self._stage.SetEndTimeCode(max(len(choice.steps) - 1, 0))
        world = UsdGeom.Xform.Define(self._stage, "/World")
        self._stage.SetDefaultPrim(world.GetPrim())
        start = float(choice.steps[0]) / recording.steps_per_second if len(choice.steps) else 0.0
        world.GetPrim().SetCustomDataByKey("crowdsim:scenario", recording.header.scenario_name)
        world.GetPrim().SetCustomDataByKey("crowdsim:start", start)
        self._geom.Scope.Define(self._stage, "/World/Materials")
        self._materials: dict[tuple[float, ...], Any] = {}
        self._add_place()

    def _material(self, paint: Paint) -> Any:
        """Return the material of a paint; equal paints share one."""
        key = (*paint.linear, paint.opacity)
        if key not in self._materials:
            material = self._shade.Material.Define(self._stage, f"/World/Materials/paint_{len(self._materials)}")
            shader = self._shade.Shader.Define(self._stage, material.GetPath().AppendChild("surface"))
            types = self._sdf.ValueTypeNames
            shader.CreateIdAttr("UsdPreviewSurface")
            shader.CreateInput("diffuseColor", types.Color3f).Set(self._gf.Vec3f(*paint.linear))
            shader.CreateInput("opacity", types.Float).Set(paint.opacity)
            shader.CreateInput("roughness", types.Float).Set(0.9)
            shader.CreateInput("metallic", types.Float).Set(0.0)
            material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
            self._materials[key] = material
        return self._materials[key]

    def _bind(self, prim: Any, paint: Paint) -> None:
        """Give a prim the material of a paint."""
        self._shade.MaterialBindingAPI.Apply(prim).Bind(self._material(paint))

    def _mesh(self, path: str, points: NDArray[Any], normals: NDArray[Any], triangles: NDArray[Any]) -> Any:
        """Define a mesh of points (n, 3) [m], normals (n, 3) and triangles (t, 3) at ``path``."""
        mesh = self._geom.Mesh.Define(self._stage, path)
        vectors = self._vt.Vec3fArray.FromNumpy
        mesh.CreatePointsAttr(vectors(np.ascontiguousarray(points, np.float32)))
        mesh.CreateNormalsAttr(vectors(np.ascontiguousarray(normals, np.float32)))
        mesh.SetNormalsInterpolation(self._geom.Tokens.vertex)
        indices = self._vt.IntArray.FromNumpy
        mesh.CreateFaceVertexCountsAttr(indices(np.full(len(triangles), 3, np.int32)))
        mesh.CreateFaceVertexIndicesAttr(indices(np.ascontiguousarray(triangles.reshape(-1), np.int32)))
        mesh.CreateSubdivisionSchemeAttr(self._geom.Tokens.none)
        mesh.CreateExtentAttr(vectors(np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float32)))
        return mesh

    def _add_place(self) -> None:
        """Add a mesh for each part of the place, shown at its times."""
        self._geom.Xform.Define(self._stage, "/World/Place")
        for number, part in enumerate(place_parts(self._recording, self._choice)):
            mesh = self._mesh(f"/World/Place/part_{number}", part.points, part.normals, part.triangles)
            mesh.GetPrim().SetDisplayName(part.name)
            mesh.CreateDoubleSidedAttr(part.paint.opacity < 1.0)
            self._bind(mesh.GetPrim(), part.paint)
            if part.shown is not None:
                self._show(mesh, part.shown)

    def _show(self, shape: Any, shown: tuple[int, ...]) -> None:
        """Make a shape visible from the frames at which it appears, until those at which it disappears.

        ``shown`` holds these frames in turn. A shape that is there all the time needs no attribute.
        """
        if shown == (0,):
            return
        seen = shape.CreateVisibilityAttr()
        if shown[0] > 0:
            seen.Set(self._geom.Tokens.invisible, 0)
        for number, frame in enumerate(shown):
            seen.Set(self._geom.Tokens.invisible if number % 2 else self._geom.Tokens.inherited, frame)

    def add_bodies(self) -> None:
        """Add all chosen agents, with the body that they inherit."""
        skeleton = self._recording.header.motion.skeleton
        joints = _joint_paths(skeleton)
        self._add_body(skeleton, joints)
        self._geom.Xform.Define(self._stage, "/World/Characters")
        looks: set[int] = set()
        worn = paints(VARIETY)
        for motion in body_motions(self._recording, self._choice):
            look = motion.agent % VARIETY
            if look not in looks:
                looks.add(look)
                self._add_look(look, worn[look])
            self._add_character(motion, look, skeleton, joints)

    def _add_body(self, skeleton: Skeleton, joints: list[str]) -> None:
        """Define the skeleton and the skinned body once, as a class that all agents inherit."""
        stage, skel = self._stage, self._skel
        stage.CreateClassPrim("/_body").SetTypeName("SkelRoot")
        rig = skel.Skeleton.Define(stage, "/_body/Skeleton")
        rig.CreateJointsAttr(joints)
        bind = zip(*(values.tolist() for values in sculpted_pose(skeleton)), strict=True)
        rig.CreateBindTransformsAttr([self._at(place, turned) for place, turned in bind])
        rig.CreateRestTransformsAttr([self._at(offset) for offset in _offsets(skeleton).tolist()])
        body = body_of(skeleton)
        self._builds, normals = bound_points(body, skeleton)
        mesh = self._mesh("/_body/Body", self._builds[0], normals, body.triangles)
        bound = skel.BindingAPI.Apply(mesh.GetPrim())
        bound.CreateSkeletonRel().SetTargets([rig.GetPath()])
        bound.CreateJointIndicesPrimvar(False, 2).Set(self._vt.IntArray.FromNumpy(body.joints.reshape(-1)))
        bound.CreateJointWeightsPrimvar(False, 2).Set(self._vt.FloatArray.FromNumpy(body.weights.reshape(-1)))
        bound.CreateGeomBindTransformAttr(self._gf.Matrix4d(1.0))
        # The number of each triangle by its corners: a subset of the mesh lists the triangles of a tissue.
        order = {tuple(corners): number for number, corners in enumerate(body.triangles.tolist())}
        self._tissues = []
        for tissue, triangles in tissue_triangles(body):
            faces = np.array([order[tuple(corners)] for corners in triangles.tolist()], np.int32)
            name = tissue.name.lower()
            self._shade.MaterialBindingAPI.Apply(mesh.GetPrim()).CreateMaterialBindSubset(
                name, self._vt.IntArray.FromNumpy(faces), self._geom.Tokens.face
            )
            self._tissues.append((tissue, name))

    def _add_look(self, look: int, worn: list[Paint]) -> None:
        """Add the class of bodies with one look; ``worn`` holds the paint of each tissue, by its number."""
        self._stage.CreateClassPrim(f"/_look_{look}").SetTypeName("SkelRoot")
        self._stage.GetPrimAtPath(f"/_look_{look}").GetInherits().AddInherit("/_body")
        points = self._builds[build_of(look)]
        # The class /_body has the points of build 0; looks of other builds have their own.
        if build_of(look):
            shaped = self._geom.Mesh(self._stage.OverridePrim(f"/_look_{look}/Body"))
            shaped.CreatePointsAttr(self._vt.Vec3fArray.FromNumpy(np.ascontiguousarray(points)))
            extent = np.stack([points.min(axis=0), points.max(axis=0)])
            shaped.CreateExtentAttr(self._vt.Vec3fArray.FromNumpy(extent))
        for tissue, name in self._tissues:
            self._bind(self._stage.OverridePrim(f"/_look_{look}/Body/{name}"), worn[tissue])

    def _add_character(self, motion: BodyMotion, look: int, skeleton: Skeleton, joints: list[str]) -> None:
        """Add an agent that inherits the body with a look, and its rotations and positions over time."""
        stage, sdf, layer = self._stage, self._sdf, self._layer
        path = f"/World/Characters/character_{motion.agent}"
        root = self._skel.Root.Define(stage, path)
        root.GetPrim().GetInherits().AddInherit(f"/_look_{look}")
        group = self._recording.header.agents.groups[motion.agent]
        root.GetPrim().SetCustomDataByKey("crowdsim:agent", motion.agent)
        root.GetPrim().SetCustomDataByKey("crowdsim:group", group)
        walk = self._skel.Animation.Define(stage, f"{path}/Walk")
        # Joints that never turn are left out of the animation; their first rotation becomes their rest pose.
        turning = np.flatnonzero((np.abs(motion.rotations - motion.rotations[:1]) > _STILL).any(axis=(0, 2)))
        walk.CreateJointsAttr([joints[joint] for joint in turning])
        walk.CreateTranslationsAttr(self._vt.Vec3fArray.FromNumpy(_offsets(skeleton)[turning].astype(np.float32)))
        walk.CreateScalesAttr(self._vt.Vec3hArray([self._gf.Vec3h(1.0, 1.0, 1.0)] * len(turning)))
        turns = walk.CreateRotationsAttr().GetPath()
        rig = stage.OverridePrim(f"{path}/Skeleton")
        rest = [
            self._at(place, turned)
            for place, turned in zip(_offsets(skeleton).tolist(), motion.rotations[0].tolist(), strict=True)
        ]
        self._skel.Skeleton(rig).CreateRestTransformsAttr(rest)
        self._skel.BindingAPI.Apply(rig).CreateAnimationSourceRel().SetTargets([walk.GetPath()])
        move = root.AddTranslateOp(self._geom.XformOp.PrecisionFloat).GetAttr().GetPath()

        packed = np.ascontiguousarray(motion.rotations[:, turning][..., [1, 2, 3, 0]])  # as Gf has them in memory
        quaternions, vector = self._vt.QuatfArray.FromNumpy, self._gf.Vec3f
        with sdf.ChangeBlock():
            for frame, turned, place in zip(motion.frames.tolist(), packed, motion.roots.tolist(), strict=True):
                layer.SetTimeSample(turns, frame, quaternions(turned))
                layer.SetTimeSample(move, frame, vector(*place))
            # Shortly before the first frame after a crossing, add a sample with the position beyond the end.
            for leap in jumps(self._recording, motion.roots):
                before = float(motion.frames[leap.row]) - _INSTANT * self._choice.rate
                layer.SetTimeSample(move, before, vector(*leap.beyond.tolist()))
        self._show(root, motion.shown(len(self._choice.steps)))

    def add_points(self) -> None:
        """Add capsules of human size on the tracks, with one prototype for each behavior."""
        header = self._recording.header
        crowd = self._geom.PointInstancer.Define(self._stage, "/World/Crowd")
        crowd.CreatePrototypesRel().SetTargets([self._capsule(n, b.color) for n, b in enumerate(header.behaviors)])
        attributes = (crowd.CreateProtoIndicesAttr(), crowd.CreateIdsAttr(), crowd.CreatePositionsAttr())
        kinds, ids, places, turns = (each.GetPath() for each in (*attributes, crowd.CreateOrientationsAttr()))
        vt, before = self._vt, _INSTANT * self._choice.rate
        last = np.empty(0, np.int64), np.empty((0, 3), np.float32), np.empty((0, 4), np.float16)

        def put(time: float, at: NDArray[np.float32], turned: NDArray[np.float16]) -> None:
            """Set positions (k, 3) [m] and rotations (k, 4) (x, y, z, w) at ``time``, in frames."""
            self._layer.SetTimeSample(places, time, vt.Vec3fArray.FromNumpy(at))
            self._layer.SetTimeSample(turns, time, vt.QuathArray.FromNumpy(turned))

        for number, step in enumerate(self._choice.steps.tolist()):
            frame = self._recording.at_step(step)
            agents = self._choice.agents[frame.state[self._choice.agents] != AgentState.ABSENT]
            zeros = np.zeros(len(agents))
            half = 0.5 * frame.heading[agents].astype(np.float64)
            at = np.column_stack([frame.x[agents], frame.y[agents], zeros]).astype(np.float32)
            turned = np.column_stack([zeros, zeros, np.sin(half), np.cos(half)]).astype(np.float16)
            with self._sdf.ChangeBlock():
                # USD interpolates arrays of equal length, even if their agents differ. So if some agents come, go, or
                # wrap at an end of a periodic floor, add a sample just before this frame: the agents of the last frame,
                # at their new positions without wrapping if they are still there.
                were, there, faced = last
                stays, to = np.isin(were, agents), np.isin(agents, were)
                there, faced = there.copy(), faced.copy()
                there[stays], wraps = unwrapped(self._recording.header.ends, there[stays], at[to])
                faced[stays] = turned[to]
                if number and not (stays.all() and to.all() and not wraps.any()):
                    put(number - before, there, faced)
                # An agent without a behavior (-1) looks as one of behavior 0.
                shown = np.maximum(frame.behavior[agents], 0).astype(np.int32)
                self._layer.SetTimeSample(kinds, number, vt.IntArray.FromNumpy(shown))
                self._layer.SetTimeSample(ids, number, vt.Int64Array.FromNumpy(agents.astype(np.int64)))
                put(number, at, turned)
            last = agents, at, turned

    def _capsule(self, number: int, color: str) -> Any:
        """Define the capsule that stands for a body of behavior ``number``; return its path."""
        top = self._geom.Xform.Define(self._stage, f"/World/Crowd/Prototypes/behavior_{number}")
        capsule = self._geom.Capsule.Define(self._stage, top.GetPath().AppendChild("body"))
        capsule.CreateAxisAttr(self._geom.Tokens.z)
        capsule.CreateRadiusAttr(_CAPSULE_RADIUS)
        # The height of a capsule in USD does not include its round ends.
        capsule.CreateHeightAttr(_CAPSULE_HEIGHT - 2.0 * _CAPSULE_RADIUS)
        corner = np.array([_CAPSULE_RADIUS, _CAPSULE_RADIUS, 0.5 * _CAPSULE_HEIGHT], np.float32)
        capsule.CreateExtentAttr(self._vt.Vec3fArray.FromNumpy(np.stack([-corner, corner])))
        capsule.AddTranslateOp().Set(self._gf.Vec3d(0.0, 0.0, 0.5 * _CAPSULE_HEIGHT))
        red, green, blue = (int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
        self._bind(capsule.GetPrim(), Paint(color, red, green, blue))
        return top.GetPath()

    def _at(self, place: list[float], turned: list[float] | None = None) -> Any:
        """Return the matrix of a position [m] and a rotation (w, x, y, z), by default none."""
        w, x, y, z = (1.0, 0.0, 0.0, 0.0) if turned is None else turned
        turn = self._gf.Matrix4d(1.0).SetRotate(self._gf.Quatd(w, x, y, z).GetNormalized())
        return turn.SetTranslateOnly(self._gf.Vec3d(*place))

    def write(self, file: Path) -> None:
        """Write the stage; raise OSError if that fails, as on a full disk."""
        from pxr import Tf

        try:
            written = self._layer.Export(str(file))
        except Tf.ErrorException:
            written = False
        if not written:  # USD does not tell a full disk from a broken one
            raise OSError(errno.EIO, "USD could not write it")


def _offsets(skeleton: Skeleton) -> NDArray[np.float64]:
    """Return joint positions (J, 3) relative to the parent [m]; 0 for the root, which the agent's position places."""
    offsets = np.array(skeleton.offsets)
    offsets[np.asarray(skeleton.parents) < 0] = 0.0
    return offsets


def _joint_paths(skeleton: Skeleton) -> list[str]:
    """Return the names of joints as paths from the root, all different, in characters that USD allows."""
    paths: list[str] = []
    for number, (name, parent) in enumerate(zip(skeleton.names, skeleton.parents.tolist(), strict=True)):
        plain = "".join(each if each.isascii() and each.isalnum() else "_" for each in name)
        own = plain if plain and not plain[0].isdigit() else f"joint_{number}_{plain}"
        path = own if parent < 0 else f"{paths[parent]}/{own}"
        # Names of siblings may differ only in characters that are replaced.
        while path in paths:
            path += "_"
        paths.append(path)
    return paths
