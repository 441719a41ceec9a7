"""Pictures and films of runs: MuJoCo's renderer off screen, the rates below it, as PNG, GIF or MP4."""

from rmrc.support.errors import QuestionError
from rmrc.support.text import line

WAY_OUT = "without a display set MUJOCO_GL=egl and install libegl1, or MUJOCO_GL=osmesa and libosmesa6"


class PictureError(QuestionError):
    """This machine cannot draw the requested picture."""


def without_opengl(error: Exception) -> PictureError:
    """Return the user's message for an error of OpenGL: MuJoCo, GLFW and PyOpenGL have their own ones."""
    reason = line(str(error).strip().partition("\n")[0])
    return PictureError(f"this machine has no OpenGL for rendering ({reason}); {WAY_OUT}")


try:
    import mujoco  # noqa: F401 - on import it chooses its way to OpenGL, and may not find it
except Exception as error:
    raise without_opengl(error) from None
