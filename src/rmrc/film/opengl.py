"""OpenGL without a display: finds a route that works here, or reports in one line that none does."""

import ctypes.util
import os
import platform
import warnings
from contextlib import AbstractContextManager
from importlib import import_module
from typing import Any

from rmrc.support.errors import QuestionError
from rmrc.support.legible import line

# Libraries by the values of MUJOCO_GL.
LIBRARIES = {"egl": "EGL", "osmesa": "OSMesa"}
WAY_OUT = "on Debian and Ubuntu install libegl1 and libgl1-mesa-dri, or in libosmesa6 for MUJOCO_GL=osmesa"


class PictureError(QuestionError):
    """This machine cannot draw the requested picture."""


def refuse_missing() -> None:
    """Refuse a missing library that MUJOCO_GL names: without it, MuJoCo itself could not be imported.

    Raises:
        PictureError: It is not here.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    library = LIBRARIES.get(asked)
    if platform.system() == "Linux" and library and not ctypes.util.find_library(library):
        raise PictureError(f"MUJOCO_GL={asked} needs lib{library}, which is missing; {WAY_OUT}")


def opened(width: int, height: int) -> Any:
    """Return an OpenGL context without a display: the one that MUJOCO_GL names, or else EGL or OSMesa.

    MuJoCo decides on import, and by default for a window, which is too early and needs a display.

    Args:
        width: Width of the pictures [pixels].
        height: Height of the pictures [pixels].

    Raises:
        PictureError: There is none.
    """
    try:
        with quietly():
            # By name: MuJoCo has a module for each route, and its import fails where the route is missing.
            return import_module(_route()).GLContext(width, height)
    except Exception as error:  # ImportError, AttributeError, RuntimeError and those of PyOpenGL
        raise no_picture(error) from None


def _route() -> str:
    """Return the module of MuJoCo that opens OpenGL here."""
    if platform.system() != "Linux" or os.environ.get("MUJOCO_GL"):
        return "mujoco"
    has_mesa_alone = not ctypes.util.find_library("EGL") and ctypes.util.find_library("OSMesa")
    return "mujoco.osmesa" if has_mesa_alone else "mujoco.egl"


def quietly() -> AbstractContextManager[Any]:
    """Suppress warnings of GLFW: the error says the same."""
    return warnings.catch_warnings(action="ignore")


def no_picture(error: Exception) -> PictureError:
    """Return the user's message for any error of OpenGL."""
    reason = line(str(error).strip().partition("\n")[0].rstrip(".")) or type(error).__name__
    return PictureError(f"this machine has no OpenGL for rendering ({reason}); {WAY_OUT}")
