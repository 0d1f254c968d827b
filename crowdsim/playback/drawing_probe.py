"""Draw a small scene off-screen and print the kind of window that drew it; exit with 0 if the picture is right.

:mod:`crowdsim.playback.drawing_backend` runs this file as a program: if there is no OpenGL, VTK does not raise but
kills the process. It imports nothing but VTK, so that it starts fast.
"""

from __future__ import annotations

import sys


def main() -> int:
    """Return 0 if a lit sphere was drawn in many shades, else 1."""
    import vtkmodules.vtkInteractionStyle
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkObject
    from vtkmodules.vtkFiltersSources import vtkSphereSource
    from vtkmodules.vtkRenderingCore import (
        vtkActor,
        vtkPolyDataMapper,
        vtkRenderer,
        vtkRenderWindow,
        vtkWindowToImageFilter,
    )

    vtkObject.GlobalWarningDisplayOff()
    sphere = vtkSphereSource()
    mapper = vtkPolyDataMapper()
    mapper.SetInputConnection(sphere.GetOutputPort())
    actor = vtkActor()
    actor.SetMapper(mapper)
    renderer = vtkRenderer()
    renderer.AddActor(actor)
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(64, 64)
    window.AddRenderer(renderer)
    window.Render()
    grab = vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.Update()
    pixels = vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars())
    sys.stdout.write(window.GetClassName())
    return 0 if len(set(pixels[:, 0].tolist())) > 4 else 1


if __name__ == "__main__":
    sys.exit(main())
