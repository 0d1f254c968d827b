"""A recording as a pyvista scene: static things are built once, moving things are rewritten in place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from crowdsim.errors import CrowdSimError
from crowdsim.playback.backdrop import Backdrop
from crowdsim.playback.camera import FIELD_OF_VIEW, Camera, place_camera
from crowdsim.playback.crowd_mesh import LEVEL_COLORS, CrowdMesh, crowd_meshes, hex_color, shown_by
from crowdsim.playback.drawing_backend import load_pyvista
from crowdsim.playback.lamps import Lamps, Look, lit_colors
from crowdsim.playback.scenery import (
    FlatMesh,
    contact_shadows,
    floor_mesh,
    grid_lines,
    meshes_mesh,
    path_ribbons,
    paths_ahead,
    solids_mesh,
)
from crowdsim.playback.surfaces import Floats, unit
from crowdsim.recording.header import AgentState, PlannedPath, SolidRecord
from crowdsim.recording.reader import Recording

TALL = 1.1
"""Height above which solids are drawn as glass, so that they do not hide agents behind them [m]."""


class _Drawn(NamedTuple):
    """VTK's objects of a crowd: meshes of bodies and of their shadows, and the actor that draws the bodies."""

    bodies: Any
    shadows: Any
    actor: Any


COLORINGS = ("behavior", "group", "agent", "level")
"""What the color of shirts can show, beside attributes of the scenario."""

_LEAST_PIXELS, _MOST_PIXELS = 16, 16384
"""Least side of a picture, and greatest side that is drawn, ``supersample`` included: graphics drivers rarely draw more
[pixels]."""

_SKY = ("#dfe6ec", "#f7f8f9")
_FLOOR = "#f8f5ef"
_GRID = "#e6e1d7"
_LOW_SOLID = "#d2bd9f"
_TALL_SOLID = "#9fb0bd"
_MOVABLE = "#b9774a"
_EDGE = "#6d7780"
_INK = "#30363c"
_LAMPS = ((-3.0, -4.0, 9.0), 0.55), ((5.0, 4.0, 6.0), 0.30)
"""Direction that light comes from, in the world, and its intensity."""
_EYE_LAMP = (-0.5, 0.6, 1.0), 0.48
"""The same, in the frame of the camera: to the right, up, back."""
_LOOK = Look(ambient=0.45, diffuse=0.72, specular=0.08, power=12)
_CONTACT = 95.0
"""Opacity, out of 255, of the shadow at the edge of a solid."""


class Scene:
    """Draws ``recording`` at any time; call :meth:`close` when done.

    Parameters
    ----------
    recording : Recording
        Recording to draw.
    size : (int, int)
        Width and height of the picture in pixels.
    color_by : str
        What the color of shirts shows: one of COLORINGS, or an attribute of the agents.
    supersample : float
        Pixels drawn per pixel of the picture, along each side.
    interactive : bool
        Whether to open a window.
    tallest : float
        How tall a body is in the drawn picture at most [pixels]; by default, all have their full number of corners.
    paths : bool
        Whether planned paths are drawn on the floor.

    Raises
    ------
    CrowdSimError
        If the coloring or the size is invalid.
    DrawingUnavailable
        If this machine cannot draw, or cannot open a window.
    """

    def __init__(
        self,
        recording: Recording,
        size: tuple[int, int],
        color_by: str = "behavior",
        supersample: float = 1,
        interactive: bool = False,
        tallest: float = np.inf,
        paths: bool = True,
    ) -> None:
        colorings = (*COLORINGS, *recording.header.agents.attributes)
        if color_by not in colorings:
            raise CrowdSimError(f"agents cannot be colored by '{color_by}'; choose one of {', '.join(colorings)}")
        most = int(_MOST_PIXELS / supersample)
        if min(size) < _LEAST_PIXELS or max(size) > most:
            raise CrowdSimError(
                f"a picture of {size[0]}x{size[1]} cannot be drawn; choose sides of {_LEAST_PIXELS} to {most} pixels"
            )
        self._pv = load_pyvista(interactive)
        from vtkmodules.vtkCommonCore import vtkUnsignedCharArray

        self._read = vtkUnsignedCharArray()
        self.recording = recording
        self.size = size
        self._supersample = supersample
        pixels = [round(side * supersample) for side in size]
        self.plotter = self._pv.Plotter(off_screen=not interactive, window_size=pixels, lighting="none")
        self.plotter.set_background(_SKY[1], top=_SKY[0])
        if supersample > 1:
            self.plotter.disable_anti_aliasing()  # the mean of several pixels smooths edges
        # Blend what is translucent, glass and what lies on the floor, in the order in which it was added: that takes a
        # quarter less of the time of a picture than weighing it by depth.
        self.plotter.renderer.SetUseOIT(False)
        self._scale = pixels[1] / 900.0  # sizes of texts and lines are given for a picture 900 pixels high
        self._crowds = crowd_meshes(recording, color_by, tallest)
        self._backdrop: Backdrop | None = None
        self._still: list[Any] = []
        self._lamps: Lamps | None = None
        self._draws_paths = paths
        self._path_actor: Any = None
        self._movables: tuple[SolidRecord, ...] = ()
        self._movable_actors: list[Any] = []
        self._light()
        self._build_place()
        # All that a camera has to see: the place, and people in it, up to 2.5 m and 1 m beyond its edges.
        low_x, high_x, low_y, high_y, low_z, high_z = self.plotter.bounds
        self._bounds = low_x - 1.0, high_x + 1.0, low_y - 1.0, high_y + 1.0, min(low_z, 0.0), max(high_z, 2.5)
        self._drawn = [self._build_crowd(crowd) for crowd in self._crowds]
        self._write_legend(color_by)

    def close(self) -> None:
        """Free the window and its graphics memory."""
        if self._backdrop is not None:
            self._backdrop.close()
        self.plotter.close()

    def keep_still(self) -> None:
        """Draw sky, floor and opaque obstacles for the last time: the camera must not move any more.

        From the next :meth:`show_time` on, bodies are lit at their corners, as VTK would do for each pixel.
        """
        self._backdrop = Backdrop(self.plotter, self._still)
        camera = self.plotter.camera
        back = unit(np.subtract(camera.position, camera.focal_point))
        right = unit(np.cross(camera.up, back))
        beside_eye = np.array(_EYE_LAMP[0]) @ np.stack([right, np.cross(back, right), back])
        places = np.array([*(place for place, _ in _LAMPS), beside_eye])
        powers = np.array([*(power for _, power in _LAMPS), _EYE_LAMP[1]])
        self._lamps = Lamps(unit(places), powers, np.array(camera.position), _LOOK)
        for drawn in self._drawn:  # VTK is to draw the colors of bodies as they are written
            drawn.actor.prop.lighting = False
            drawn.actor.prop.ambient, drawn.actor.prop.diffuse = 1.0, 0.0

    def show_time(self, time: float) -> None:
        """Move agents, paths, movables and the clock to ``time`` [s].

        Place the camera before: which bodies are drawn finer depends on how near it is.
        """
        camera = self.plotter.camera
        shown = shown_by(self._crowds, self.recording, time, camera.position, camera.focal_point)
        for crowd, drawn, agents in zip(self._crowds, self._drawn, shown, strict=True):
            crowd.update(time, agents)
            self._move(crowd, drawn)
        frame = self.recording.at_time(time)
        if self._draws_paths:
            # Agents that do not go have no path ahead; `paths_ahead` leaves out those at nan.
            going = (frame.state == AgentState.MOVING) | (frame.state == AgentState.WAITING)
            places = (np.where(going, each, np.nan) for each in (frame.x, frame.y))
            self._draw_paths(paths_ahead(self.recording.paths_at(time), *places))
        movables = self.recording.movables_at(time)
        if movables != self._movables:
            self._draw_movables(movables)
        self._clock.input = f"{time:.2f} s"

    def _move(self, crowd: CrowdMesh, drawn: _Drawn) -> None:
        """Rewrite the drawn bodies and shadows of a crowd.

        VTK lights bodies by their normals until :meth:`keep_still`; after it, their colors are written already lit.
        """
        for mesh, points in ((drawn.bodies, crowd.points), (drawn.shadows, crowd.shadow_points)):
            mesh.points[:] = points.reshape(-1, 3)
        if self._lamps is None:
            drawn.bodies.point_data["normals"][:] = crowd.normals.reshape(-1, 3)
            drawn.bodies.GetPointData().GetArray("normals").Modified()
            colors = crowd.colors
        else:
            colors = lit_colors(crowd.colors, crowd.points, crowd.normals, self._lamps)
        drawn.bodies.point_data["colors"][:] = colors.reshape(-1, 3)
        drawn.bodies.GetPointData().GetArray("colors").Modified()
        for mesh in (drawn.bodies, drawn.shadows):
            mesh.GetPoints().Modified()
            mesh.Modified()

    def look(self, view: str, time: float, agent: int | None = None) -> None:
        """Place the camera of ``view`` at ``time`` [s]; the view ``follow`` needs an ``agent``."""
        self.set_camera(place_camera(self.recording, view, self.size[0] / self.size[1], time, agent))

    def set_camera(self, camera: Camera) -> None:
        """Look through ``camera``."""
        self.plotter.camera.view_angle = FIELD_OF_VIEW
        self.plotter.camera_position = [tuple(camera.eye), tuple(camera.target), tuple(camera.up)]
        self.plotter.camera.parallel_projection = camera.half_height is not None
        if camera.half_height is not None:
            self.plotter.camera.parallel_scale = camera.half_height
        # How far the camera sees depends on the place alone: so pictures of a time are equal whatever was drawn before.
        self.plotter.renderer.ResetCameraClippingRange(self._bounds)

    def drawn_rows(self) -> NDArray[np.uint8]:
        """Draw; return all pixels (height, width, 4), uint8 red, green, blue and alpha, the lowest row first.

        Height and width are those of the picture times ``supersample``. The next call writes into the same memory.
        """
        from vtkmodules.util.numpy_support import vtk_to_numpy

        window = self.plotter.render_window
        if self._backdrop is not None:
            self._backdrop.lay()
        window.Render()
        width, height = window.GetSize()
        window.GetRGBACharPixelData(0, 0, width - 1, height - 1, 0, self._read, 0)
        rows: NDArray[np.uint8] = vtk_to_numpy(self._read)  # type: ignore[no-untyped-call]
        return rows.reshape(height, width, 4)

    def picture(self) -> NDArray[np.uint8]:
        """Return the current picture (height, width, 3) uint8: each pixel is the mean of those drawn for it."""
        from PIL import Image

        pixels = np.ascontiguousarray(self.drawn_rows()[::-1, :, :3])
        return np.asarray(Image.fromarray(pixels).resize(self.size, Image.Resampling.BOX))

    def _light(self) -> None:
        """Add soft light from the sky, and a lamp beside the eye so that no visible side is black."""
        for (place, power), kind in (*((lamp, "scene light") for lamp in _LAMPS), (_EYE_LAMP, "camera light")):
            self.plotter.add_light(self._pv.Light(position=place, light_type=kind, intensity=power))

    def _build_place(self) -> None:
        """Add floor, grid, shadows and obstacles, tall ones as glass; draw the floor's outline 4 mm above the floor."""
        header = self.recording.header
        floor = floor_mesh(header)
        self._add_flat(floor.points, floor.triangles, _FLOOR, lighting=False)
        self._add_lines(grid_lines(header), _GRID, 1.0)
        self._add_shadows()
        self._add_lines(floor.outline + [0.0, 0.0, 0.004], _EDGE, 1.5)
        self._add_solids(header.solids, _LOW_SOLID, _TALL_SOLID, 0.2)
        low = [mesh for mesh in header.meshes if mesh.points[:, 2].max(initial=0.0) <= TALL]
        tall = [mesh for mesh in header.meshes if mesh.points[:, 2].max(initial=0.0) > TALL]
        self._add_shapes(meshes_mesh(low), meshes_mesh(tall), _LOW_SOLID, _TALL_SOLID, 0.2)
        # What `keep_still` draws once, under all later pictures. Not glass: that is drawn after the people behind it.
        self._still = [actor for actor in self.plotter.renderer.GetViewProps() if actor.prop.opacity == 1.0]

    def _add_shadows(self) -> None:
        """Add soft shadows to the floor where solids touch it."""
        header = self.recording.header
        mesh, dark = contact_shadows(header.solids, header.floor)
        if not len(mesh.triangles):
            return
        flat = self._poly(mesh.points, mesh.triangles)
        shade = np.column_stack([np.full((len(dark), 3), 30.0), _CONTACT * dark])
        flat.point_data["colors"] = shade.astype(np.uint8)
        self.plotter.add_mesh(flat, scalars="colors", rgb=True, lighting=False, show_scalar_bar=False, render=False)

    def _draw_movables(self, movables: tuple[SolidRecord, ...]) -> None:
        """Draw ``movables``, doors and obstacles that events move, in place of those drawn before."""
        for actor in self._movable_actors:
            self.plotter.remove_actor(actor, render=False)
        self._movables = movables
        self._movable_actors = self._add_solids(movables, _MOVABLE, _MOVABLE, 0.55)

    def _add_solids(self, solids: Sequence[SolidRecord], low_color: str, tall_color: str, opacity: float) -> list[Any]:
        """Draw solids, tall ones as glass with this ``opacity``; return the actors."""
        low = solids_mesh([solid for solid in solids if solid.top <= TALL])
        tall = solids_mesh([solid for solid in solids if solid.top > TALL])
        return self._add_shapes(low, tall, low_color, tall_color, opacity)

    def _add_shapes(self, low: FlatMesh, tall: FlatMesh, low_color: str, tall_color: str, opacity: float) -> list[Any]:
        """Add low shapes as solid and tall ones as glass of ``opacity``, with their outlines; return the actors."""
        glass = {"ambient": 0.4, "diffuse": 0.6, "opacity": opacity, "culling": "back"}
        actors = [
            self._add_flat(low.points, low.triangles, low_color, ambient=0.45, diffuse=0.65),
            self._add_lines(low.outline, _EDGE, 1.0),
            self._add_flat(tall.points, tall.triangles, tall_color, **glass),
            self._add_lines(tall.outline, _EDGE, 1.2),
        ]
        return [actor for actor in actors if actor is not None]

    def _build_crowd(self, crowd: CrowdMesh) -> _Drawn:
        """Add the meshes of bodies and their shadows, whose points and colors :meth:`show_time` rewrites."""
        shadows = self._poly(crowd.shadow_points.reshape(-1, 3), crowd.shadow_triangles)
        shadows.point_data["colors"] = crowd.shadow_colors
        self.plotter.add_mesh(shadows, scalars="colors", rgb=True, lighting=False, show_scalar_bar=False)
        bodies = self._poly(crowd.points.reshape(-1, 3), crowd.triangles)
        bodies.point_data["colors"] = crowd.colors.reshape(-1, 3)
        bodies.point_data["normals"] = crowd.normals.reshape(-1, 3)
        bodies.GetPointData().SetActiveNormals("normals")
        actor = self.plotter.add_mesh(
            bodies,
            scalars="colors",
            rgb=True,
            ambient=_LOOK.ambient,
            diffuse=_LOOK.diffuse,
            specular=_LOOK.specular,
            specular_power=_LOOK.power,
            culling="back",
            show_scalar_bar=False,
        )
        actor.prop.interpolation = "Phong"
        return _Drawn(bodies, shadows, actor)

    def _draw_paths(self, paths: Sequence[PlannedPath]) -> None:
        """Replace the ribbons of planned paths, in the colors of their behaviors; hide them if there are none."""
        points, triangles, behaviors = path_ribbons(paths)
        if self._path_actor is not None:
            self._path_actor.visibility = len(triangles) > 0
        if not len(triangles):
            return
        mesh = self._poly(points, triangles)
        palette = np.array([hex_color(behavior.color) for behavior in self.recording.header.behaviors])
        mesh.cell_data["colors"] = palette[behaviors]
        # The first ribbons get an actor; later ones replace its mesh.
        if self._path_actor is not None:
            self._path_actor.mapper.dataset = mesh
            return
        self._path_actor = self.plotter.add_mesh(
            mesh, scalars="colors", rgb=True, lighting=False, opacity=0.75, show_scalar_bar=False, render=False
        )

    def _write_legend(self, color_by: str) -> None:
        """Write what the colors mean below left, and the scenario's name and the clock above left.

        Sizes and places are pixels of a picture 900 pixels high, times ``_scale``; places count from its lower left.
        """
        size = round(11 * self._scale)
        left, line = 18.0 * self._scale, 26.0 * self._scale
        legend = self._crowds[0].legend
        if color_by == "behavior":
            legend = [(behavior.name, behavior.color) for behavior in self.recording.header.behaviors]
        elif color_by == "level":
            legend = [(level.name.lower(), color) for level, color in LEVEL_COLORS.items()]
        for row, (words, color) in enumerate(legend):
            self._write(words.replace("_", " "), (left, 14.0 * self._scale + row * line), size, color)
        top = self.size[1] * self._supersample - 40.0 * self._scale
        self._write(self.recording.header.scenario_name, (left, top), size, _INK)
        self._clock = self._write("", (left, top - line), size, _INK)

    def _write(self, words: str, position: tuple[float, float], size: int, color: str) -> Any:
        """Write words on a plate that keeps them legible in front of anything; return their actor.

        ``position`` is that of their lower left corner, from the lower left of the window [pixels].
        """
        text = self.plotter.add_text(words, position=position, font_size=size, color=color)
        text.prop.background_color, text.prop.background_opacity = _SKY[1], 0.7
        return text

    def _poly(self, points: Floats | NDArray[np.float32], triangles: NDArray[np.int64]) -> Any:
        """Return pyvista's mesh of triangles (F, 3) over points (V, 3) [m]."""
        return self._pv.PolyData.from_regular_faces(np.ascontiguousarray(points, np.float32), triangles)

    def _add_flat(self, points: Floats, triangles: NDArray[np.int64], color: str, **look: Any) -> Any:
        """Add triangles (k, 3) of points (n, 3) [m] in flat shades; return their actor, None if there are none.

        ``look`` holds further arguments of pyvista's ``add_mesh``.
        """
        if not len(triangles):
            return None
        return self.plotter.add_mesh(
            self._poly(points, triangles), color=color, smooth_shading=False, render=False, **look
        )

    def _add_lines(self, ends: Floats, color: str, width: float) -> Any:
        """Add segments by pairs of ends (2 n, 3) [m]; return their actor, None if there are none.

        ``width`` is in pixels of a picture 900 pixels high.
        """
        if not len(ends):
            return None
        cells = np.column_stack([np.full(len(ends) // 2, 2), np.arange(len(ends)).reshape(-1, 2)]).ravel()
        mesh = self._pv.PolyData(np.ascontiguousarray(ends, np.float32), lines=cells)
        return self.plotter.add_mesh(mesh, color=color, line_width=width * self._scale, lighting=False, render=False)
