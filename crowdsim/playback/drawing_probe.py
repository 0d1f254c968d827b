"""Draw a small scene off-screen and print the kind of window that drew it; leave with 0 if it is really there.

Run as a program by :mod:`crowdsim.playback.drawing_backend`: where no OpenGL can be had VTK does not raise, it
kills the process. It imports VTK alone, so that it starts fast.
"""

from __future__ import annotations

import sys


def main() -> int:
    """0 when a lit sphere came back as pixels of many shades, 1 when something else did."""
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
