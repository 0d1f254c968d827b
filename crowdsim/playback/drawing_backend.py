"""Find out how this machine can draw, before VTK has a chance to crash the process."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import platform
import subprocess
import sys
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from crowdsim.cache_place import cache_base
from crowdsim.errors import DrawingUnavailable

_WINDOW_VARIABLE = "VTK_DEFAULT_OPENGL_WINDOW"
_PROBE = Path(__file__).with_name("drawing_probe.py")
_PROBE_SECONDS = 60

_INSTALL = (
    "install software drawing, for example with 'apt-get install libegl1 libgl1-mesa-dri' (EGL) or 'apt-get install "
    "libosmesa6' (OSMesa), or run where there is a display"
)


@dataclass(frozen=True)
class DrawingBackend:
    """A way to draw that was tested.

    Attributes
    ----------
    name : str
        ``display``, ``egl`` or ``osmesa``.
    window : str or None
        Value for VTK_DEFAULT_OPENGL_WINDOW; None for VTK's own choice.
    """

    name: str
    window: str | None

    @property
    def interactive(self) -> bool:
        """Return whether a window can be opened, beside making pictures."""
        return self.name == "display"


_DISPLAY = DrawingBackend("display", None)
_EGL = DrawingBackend("egl", "vtkEGLRenderWindow")
_OSMESA = DrawingBackend("osmesa", "vtkOSOpenGLRenderWindow")


def find_backend() -> DrawingBackend:
    """Return the best backend of this machine; remember it in the cache folder.

    Backends are tested again after a boot (known on Linux only), and if VTK, the Python interpreter or an environment
    variable that decides on drawing has changed.

    Raises
    ------
    DrawingUnavailable
        If no backend works.
    """
    memory = _memory_file()
    key = _situation()
    known = _recall(memory, key)
    if known is not None:
        return known
    tried = []
    for backend in _candidates():
        failure = _probe(backend)
        if failure is None:
            _remember(memory, key, backend)
            return backend
        tried.append(f"{backend.name}: {failure}")
    raise DrawingUnavailable(f"nothing here can draw ({'; '.join(tried)}); {_INSTALL}")


def load_pyvista(interactive: bool = False) -> Any:
    """Return pyvista, set up for the backend of this machine; ``interactive`` if it is to open a window.

    Raises
    ------
    DrawingUnavailable
        If no backend works, or ``interactive`` is True and there is no display.
    """
    backend = find_backend()
    if interactive and not backend.interactive:
        raise DrawingUnavailable(
            "there is no display to open a window on; make a picture or a film instead ('crowdsim play FILE --shot "
            "out.png' or '--film out.mp4')"
        )
    # VTK reads the first variable when it makes a window. Mesa's EGL reads the second; without it, EGL warns if there
    # is no graphics card.
    if backend.window is not None:
        os.environ[_WINDOW_VARIABLE] = backend.window
    os.environ.setdefault("EGL_LOG_LEVEL", "fatal")
    import pyvista
    from vtkmodules.vtkCommonCore import vtkObject

    vtkObject.GlobalWarningDisplayOff()
    return pyvista


def _candidates() -> list[DrawingBackend]:
    """Return the backends to test, the best first; EGL and OSMesa, which need no display, are for Linux only."""
    if not sys.platform.startswith("linux"):
        return [_DISPLAY]
    has_display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    return [_DISPLAY, _EGL, _OSMESA] if has_display else [_EGL, _OSMESA]


def _probe(backend: DrawingBackend) -> str | None:
    """Test ``backend`` in a process of its own; return None if it drew, else what happened."""
    environment = {name: text for name, text in os.environ.items() if name != _WINDOW_VARIABLE}
    if backend.window is not None:
        environment[_WINDOW_VARIABLE] = backend.window
    try:
        # -P: modules in the folder of the probe must not hide others of the same name.
        done = subprocess.run(
            [sys.executable, "-P", str(_PROBE)],
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=_PROBE_SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"no picture within {_PROBE_SECONDS} s"
    except OSError as error:
        return str(error)
    if done.returncode < 0:  # ended by a signal
        return "OpenGL crashes"
    if done.returncode > 0:
        last = done.stderr.strip().splitlines()[-1:]
        return last[0] if last else "the picture stayed empty"
    # Without a usable display, VTK silently falls back to EGL, which cannot open a window.
    drawn_by = done.stdout.strip()
    if backend is _DISPLAY and drawn_by in (_EGL.window, _OSMESA.window):
        return "the display does not answer"
    return None


def _situation() -> str:
    """Return a hash of everything that decides which backend works: boot, VTK, interpreter, environment."""
    # Linux has an id for each boot; on other systems, the machine's name has to do.
    boot = Path("/proc/sys/kernel/random/boot_id")
    machine = boot.read_text().strip() if boot.exists() else platform.node()
    prefixes = (
        "DISPLAY",
        "WAYLAND_DISPLAY",
        "VTK_",
        "EGL_",
        "LIBGL_",
        "MESA_",
        "GALLIUM_",
        "LD_LIBRARY_PATH",
        "__GLX",
        "__EGL",
    )
    settings = sorted((name, text) for name, text in os.environ.items() if name.startswith(prefixes))
    # load_pyvista sets these two itself.
    settings = [(name, text) for name, text in settings if name not in (_WINDOW_VARIABLE, "EGL_LOG_LEVEL")]
    text = repr((machine, sys.executable, version("vtk"), settings))
    return hashlib.sha256(text.encode()).hexdigest()


def _memory_file() -> Path:
    """Return the file that holds the backend that was found last."""
    return cache_base() / "drawing.json"


def _recall(memory: Path, key: str) -> DrawingBackend | None:
    """Return the backend that the file ``memory`` holds for the situation ``key``; None without one.

    A file that cannot be read or is damaged counts as none.
    """
    try:
        known = json.loads(memory.read_text())
        return DrawingBackend(**known["backend"]) if known["situation"] == key else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _remember(memory: Path, key: str, backend: DrawingBackend) -> None:
    """Store the backend that worked in the file ``memory``, for the situation ``key``, if the file can be written.

    Failures are not stored but tested again, because the user may have installed something.
    """
    text = json.dumps({"situation": key, "backend": asdict(backend)})
    written = memory.with_name(f"{memory.name}.{os.getpid()}")
    try:
        memory.parent.mkdir(parents=True, exist_ok=True)
        written.write_text(text)
        os.replace(written, memory)
    except OSError:
        with contextlib.suppress(OSError):
            written.unlink()
