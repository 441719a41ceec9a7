"""The controls of drag mode: a gizmo at the goal, nudges by buttons and keys, and a slider for each joint."""

import math
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.explore.drag import Drag
from rmrc.simulation.prepare import Prepared
from rmrc.support.spatial import AXES, exp_rotation, quat_multiply

# Size of the gizmo, and step of a nudge: parts of the reach; step of a nudge that turns [rad].
GIZMO, NUDGE, TURN = 0.3, 0.01, math.radians(2.0)
# The range of a joint without limits [rad or m], and the steps of its slider.
FREE, STEP = math.pi, 0.001
# With more joints the folder of their sliders starts closed.
FEW = 3
# Labels of the rows of nudges; each has room for the buttons of two axes.
ROWS = ("nudge", "nudge z", "turn", "turn z")
TO_TIP, TO_START = "goal to the tip", "arm to the start"


class Hand:
    """Controls that move the arm. Their events wait for the thread of the session.

    Args:
        client: The browser, as viser represents it.
        prepared: The scenario.
        reach: Of the arm [m].
        wake: Called after each event.
    """

    def __init__(self, client: Any, prepared: Prepared, reach: float, wake: Callable[[], None]) -> None:
        """Lay the controls out, hidden."""
        arm, task, gui = prepared.arm, prepared.scenario.task, client.gui
        self._waits: deque[Callable[[Drag], None]] = deque()
        self._wake, self._unit, self.is_restarted = wake, _round(NUDGE * reach), False
        own = set(task.axes) if task.frame == "world" else set(AXES)
        turns = [axis in own for axis in AXES[3:]]
        active = tuple(axis in own for axis in AXES[:3])
        if sum(turns) > 1:  # a ring needs the arrows of two axes; motions that the task lacks have no effect
            active = (True, True, True)
        self._turns = any(turns)
        self._gizmo = client.scene.add_transform_controls(
            "/goal", GIZMO * reach, active_axes=active, disable_rotations=not self._turns, depth_test=False,
            visible=False,
        )  # fmt: skip
        self._gizmo.on_update(lambda _: self._ask(self._lead))
        self._folder = gui.add_folder(None, visible=False)
        with self._folder:
            back = gui.add_button_group("back", (TO_TIP, TO_START), hint="key R: arm to the start")
            back.on_click(lambda event: self._return(event.target.value))
            gui.add_command(TO_START, hotkey="R").on_trigger(lambda _: self._return(TO_START))
            hint = f"by {self._unit:.2g} m or {math.degrees(TURN):g} deg; arrow keys, page up and down"
            for label, axes in zip(ROWS, (AXES[:2], AXES[2:3], AXES[3:5], AXES[5:]), strict=True):
                names = tuple(f"{sign}{axis}" for axis in axes if axis in own for sign in "−+")
                if names:
                    group = gui.add_button_group(label, names, hint=hint)
                    group.on_click(lambda event: self._ask(partial(self._nudge, event.target.value)))
            with gui.add_folder("joints", expand_by_default=arm.n <= FEW):
                self._sliders = [self._slider(gui, prepared, j) for j in range(arm.n)]

    def _slider(self, gui: Any, prepared: Prepared, j: int) -> Any:
        """Return the slider of a joint."""
        arm, limits = prepared.arm, prepared.arm.position_limit[j]
        low, high = np.where(np.isfinite(limits), limits, (-FREE, FREE)).round(3).tolist()
        start = float(prepared.qpos[arm.wiring.qpos][j].round(3))
        hint = f"where it goes [{arm.units[j]}]"
        slider = gui.add_slider(arm.joints[j], min(low, start), max(high, start), STEP, start, hint=hint)

        def jog(event: Any) -> None:
            if event.client is not None:  # the reader moved it, not this session
                self._ask(lambda drag: drag.jog(j, slider.value))

        slider.on_update(jog)
        return slider

    def _ask(self, change: Callable[[Drag], None]) -> None:
        self._waits.append(change)
        self._wake()

    def _return(self, where: str) -> None:
        self.is_restarted |= where == TO_START
        self._ask(self._let_go)

    def _lead(self, drag: Drag) -> None:
        turn = self._gizmo.wxyz if self._turns else drag.goal[3:]
        drag.lead(np.concatenate([self._gizmo.position, turn]))

    def _let_go(self, drag: Drag) -> None:
        drag.lead(drag.pose)
        self._follow(drag.pose)

    def _nudge(self, name: str, drag: Drag) -> None:
        goal, row = np.array(drag.goal if drag.joints is None else drag.pose), AXES.index(name[1:])
        side = 1.0 if name[0] == "+" else -1.0
        if row < 3:
            goal[row] += side * self._unit
        else:
            goal[3:] = quat_multiply(exp_rotation(side * TURN * np.eye(3)[row - 3]), goal[3:])
        drag.lead(goal)
        self._follow(goal)

    def _follow(self, pose: NDArray[np.float64]) -> None:
        self._gizmo.position = pose[:3]
        if self._turns:
            self._gizmo.wxyz = pose[3:]

    def take(self, drag: Drag) -> None:
        """Apply the requests since the last call."""
        while self._waits:
            self._waits.popleft()(drag)

    def show(self, drag: Drag | None) -> None:
        """Show the controls for an arm at a new place, or hide them."""
        self._folder.visible = self._gizmo.visible = drag is not None
        self._waits.clear()
        self.is_restarted = False
        if drag is not None:
            self._follow(drag.goal)
            self.tell(drag)

    def tell(self, drag: Drag) -> None:
        """Show the joint positions; the gizmo follows the tip while single joints move."""
        if drag.joints is not None:
            self._follow(drag.pose)
            return
        for slider, position in zip(self._sliders, drag.q, strict=True):
            slider.value = min(max(round(float(position), 3), slider.min), slider.max)


def _round(step: float) -> float:
    """Return 1, 2 or 5 times a power of ten, not above a step but by rounding.

    >>> _round(0.021), _round(0.0099), _round(0.01 * (1.0 - 2e-16))
    (0.02, 0.005, 0.01)
    """
    power = 10.0 ** math.floor(math.log10(step))
    most = step * (1.0 + 1e-9)  # its logarithm may round up to a whole number
    return float(f"{next(part * power for part in (5.0, 2.0, 1.0) if part * power <= most):.1g}")
