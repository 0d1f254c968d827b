"""What stands still before a camera that stands still: drawn once, then copied under each picture of a film."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

# Constants of OpenGL, which VTK does not name in Python: COLOR_BUFFER_BIT | DEPTH_BUFFER_BIT, READ_FRAMEBUFFER and
# DRAW_FRAMEBUFFER, NEAREST (depths cannot be interpolated), SCISSOR_TEST.
_COLOR_AND_DEPTH = 0x4000 | 0x0100
_READ, _DRAW = 0x8CA8, 0x8CA9
_NEAREST = 0x2600
_SCISSOR = 0x0C11
_DEPTH_BITS = 32
"""Bits of a depth, as VTK's own windows have them: depths are copied between equal formats only."""


class Backdrop:
    """Colors and depths of the sky and of ``still`` actors before the present camera of ``plotter``.

    They are drawn once, here. Then ``still`` actors become invisible, and the plotter draws only the others, on top of
    a copy. The copied depths hide what is behind ``still`` actors, as if these were drawn. Call :meth:`lay` before each
    picture. The camera and the size of the window must not change any more.
    """

    def __init__(self, plotter: Any, still: Sequence[Any]) -> None:
        from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLFramebufferObject

        self._window, renderer = plotter.render_window, plotter.renderer
        moving = [prop for prop in renderer.GetViewProps() if prop not in still and prop.GetVisibility()]
        for prop in moving:
            prop.SetVisibility(False)
        self._window.Render()
        self._drawn = self._window.GetRenderFramebuffer()
        self._size = tuple(self._window.GetSize())
        self._window.MakeCurrent()
        self._kept = vtkOpenGLFramebufferObject()
        self._kept.SetContext(self._window)
        state = self._window.GetState()
        state.PushFramebufferBindings()
        # 3 is VTK_UNSIGNED_CHAR. The two True ask for textures and for depths, False for no stencil.
        one_color, of_bytes, samples = 1, 3, 0
        self._kept.PopulateFramebuffer(
            self._size[0], self._size[1], True, one_color, of_bytes, True, _DEPTH_BITS, samples, False
        )
        state.PopFramebufferBindings()
        self._copy(self._drawn, self._kept)
        for prop in moving:
            prop.SetVisibility(True)
        for prop in still:
            prop.SetVisibility(False)
        self._window.SetFrameBlitModeToNoBlit()  # nobody looks at the window itself
        # Do not clear what `lay` has copied before a picture is drawn.
        renderer.SetPreserveColorBuffer(True)
        renderer.SetPreserveDepthBuffer(True)

    def lay(self) -> None:
        """Copy the backdrop to where the next picture is drawn."""
        self._window.MakeCurrent()
        self._copy(self._kept, self._drawn)

    def close(self) -> None:
        """Free the copy."""
        self._kept.ReleaseGraphicsResources(self._window)

    def _copy(self, source: Any, target: Any) -> None:
        """Copy color and depth of one of VTK's frame buffers to another of the same size."""
        state = self._window.GetState()
        state.PushFramebufferBindings()
        # The scissor test would limit the copy to the rectangle of the last renderer.
        state.vtkglDisable(_SCISSOR)
        source.Bind(_READ)
        source.ActivateReadBuffer(0)
        target.Bind(_DRAW)
        target.ActivateDrawBuffer(0)
        state.vtkglBlitFramebuffer(0, 0, *self._size, 0, 0, *self._size, _COLOR_AND_DEPTH, _NEAREST)
        state.PopFramebufferBindings()
