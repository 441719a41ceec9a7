"""The session of one browser: its settings, their answers, and the shown instant."""

import html
import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

from rmrc.explore import plots, rows, saving
from rmrc.explore.answer import Answer, Explored
from rmrc.explore.controls import Control, Value, read_of
from rmrc.explore.drag import PERIOD, RECENT, Drag
from rmrc.explore.hand import GIZMO, Hand
from rmrc.explore.page import EXTRAS
from rmrc.explore.picture import ROOM, Picture, view
from rmrc.results.run import Run
from rmrc.scenario import Scenario
from rmrc.scenario.lesson import Lesson
from rmrc.support.errors import RmrcError
from rmrc.support.invocation import command

MARKS = {"velocity": "velocity ellipsoid", "force": "force ellipsoid", "lost": "lost direction"}
BEFORE, WRITTEN, NOTHING = "the setting before", "as written", "nothing"
RUN, DRAG = "run", "drag"
SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1": 1.0, "2": 2.0}
# Widths of the panels, heights of the plots [px]: a screen of 1280 × 720 has room for the arm beside them.
SETTINGS, PLOTS, HEIGHT = 320, 420, 118
# Periods of the pictures, of the shown time while the run plays, and of the plots in drag mode [s].
FRAME, TOLD, PLOTTED = 1 / 30, 0.1, 0.2
# Changes of one key within this time are one gesture, which keeps the setting before it [s].
GESTURE = 1.5
# A new setting ends a run that takes longer [s].
LONG = 0.5
# The page shows a real-time factor below this.
KEPT_UP = 0.95
# In drag mode the goal can go so far beyond arm and path with its gizmo in view: part of the reach.
PULL = 0.15
# Least width over height of the canvas beside the panels.
ASPECT = 0.3


class Session:
    """The state of one browser; its own thread runs the scenario and moves the arm.

    Args:
        scenario: The scenario to explore.
        out: The folder for saved files.
        lesson: The lesson for the reader, if there is one.
        drags: Whether it begins in drag mode.
        client: The browser, as viser represents it.
        failed: Called with the error that ended the session.

    Attributes:
        answer: The shown answer; None before the first.
        controls: The keys that the page can change.
        drag: The arm in drag mode; None in run mode.
    """

    drag: Drag | None

    def __init__(
        self,
        scenario: Scenario,
        out: Path,
        lesson: Lesson | None,
        drags: bool,
        client: Any,
        failed: Callable[[Exception], None],
    ) -> None:
        """Prepare the session; `start` runs it."""
        self._scenario, self._out, self._lesson = scenario, out, lesson
        self._client, self._failed = client, failed
        self.answer: Answer | None = None
        self.controls: tuple[Control, ...] = ()
        self._before: Answer | None = None
        self._lock, self._wake, self._stop = threading.Lock(), threading.Event(), threading.Event()
        self._closed = False
        self._values: dict[str, Value] = {}
        self._is_asked = self._is_redrawn = self._is_saved = False
        self._drags, self.drag = drags, None
        self._gesture, self._began, self._answers = ("", 0.0), 0.0, 0
        self._time, self._plays, self._loops, self._speed = 0.0, False, True, 1.0
        self._thread = threading.Thread(target=self._live, name="rmrc explore", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the session, and free its answers."""
        with self._lock:
            self._closed = True
            self._stop.set()
        self._wake.set()

    # Its thread ------------------------------------------------------------------------------

    def _live(self) -> None:
        """Show the scenario, and answer changes until a call of `close` or an error."""
        try:
            explored = Explored(self._scenario)
            self._build(explored)
            self._take(explored.written)
            self._go_on(explored)
        except Exception as error:
            if not self._closed:
                with suppress(Exception):  # the browser may have gone
                    self._client.gui.reset()
                    self._client.gui.add_markdown("An error in rmrc ended this session. Reload the page.")
                self._failed(error)
        finally:
            self.answer = self._before = self.drag = None

    def _go_on(self, explored: Explored) -> None:
        last = told = time.perf_counter()
        self._wake.set()  # the session may begin in drag mode
        while not self._closed:
            moves = self._plays or (self.drag is not None and not self.drag.is_still)
            self._wake.wait(FRAME if moves else None)
            self._wake.clear()
            now = time.perf_counter()
            passed, last = (now - last if moves else FRAME), now
            self._catch_up(explored)
            if self.drag is not None:
                if self._is_asked or self._hand.is_restarted:
                    self._tune(explored)
                told = self._lead(passed, now, told)
                continue
            if self._is_asked:
                self._ask(explored)
                last = time.perf_counter()
            if self._is_redrawn:
                self._publish()
            assert self.answer is not None
            if self._plays:
                self._advance(passed)
            if not self._plays or now - told > TOLD:
                told = now
                self._tell_time()
            with self._client.atomic():
                self._picture.at(self.answer, self._other, self._time)

    def _catch_up(self, explored: Explored) -> None:
        """Apply the reader's requests since the last picture."""
        if self._drags != (self.drag is not None):
            self._switch(explored)
        if self._is_saved:
            self._save(explored)
        if not self._is_fitted:
            self._aim()

    def _switch(self, explored: Explored) -> None:
        """Begin or end drag mode by the reader's choice."""
        self._play(False)
        if self._drags:
            self._tune(explored)
            self._aim()
            self._drags = self.drag is not None
            _set(self._mode, "value", DRAG if self._drags else RUN)
        else:
            self.drag, self._is_asked = None, True
            self._hand.show(None)
        for handle in (self._player, self._clock):
            handle.visible = not self._drags

    def _tune(self, explored: Explored) -> None:
        """Move the arm on with the latest setting, or from the start; an invalid setting changes nothing."""
        assert self.answer is not None
        with self._lock:
            self._is_asked, values = False, dict(self._values)
        self._answers += 1
        before, self._hand.is_restarted = None if self._hand.is_restarted else self.drag, False
        if self.drag is None:
            self._say("the arm gets ready; the first time may take half a minute")
        try:
            self.drag = Drag(explored.prepared(values, PERIOD), values, self.answer, before)
        except RmrcError as error:
            self._say(str(error).splitlines()[0], is_wrong=True)
            return
        self._say("")
        if before is None:
            self._hand.show(self.drag)
            self._picture.show(self.drag.recent(), None)

    def _lead(self, passed: float, now: float, told: float) -> float:
        """Advance the arm by the passed time, and show it; return when the plots were last drawn."""
        drag = self.drag
        assert drag is not None
        self._hand.take(drag)
        drag.advance(passed)
        with self._client.atomic():
            self._picture.at(drag.now(), None, 0.0)
        if not self._is_redrawn and now - told < PLOTTED and not drag.is_still:
            return told
        self._hand.tell(drag)
        self._draw(drag.recent(), None)
        if drag.trouble:
            self._say(drag.trouble, is_wrong=True)
        else:
            is_late = drag.factor < KEPT_UP
            self._say(f"this machine runs the arm at {drag.factor:.2f} of real time" if is_late else "")
        return now

    def _advance(self, passed: float) -> None:
        """Advance by the passed time; at the end, start again or stop."""
        assert self.answer is not None
        self._time += passed * self._speed
        if self._time > self.answer.end:
            self._time = 0.0 if self._loops else self.answer.end
            if not self._loops:
                self._play(False)

    def _ask(self, explored: Explored) -> None:
        """Run the scenario with the latest setting; an invalid one leaves the page unchanged."""
        with self._lock:
            self._is_asked, values = False, dict(self._values)
            self._stop, self._began = threading.Event(), time.perf_counter()
            if self._closed:
                self._stop.set()
        self._answers += 1
        try:
            answer = explored.answer(values, self._stop)
        except RmrcError as error:
            self._say(str(error).splitlines()[0], is_wrong=True)
            return
        if answer is None:
            return
        self._take(answer)
        self._say(f"ran again in {1e3 * (time.perf_counter() - self._began):.0f} ms")

    def _take(self, answer: Answer) -> None:
        """Show an answer, and keep the one before it unless both belong to one gesture."""
        key, when = self._gesture
        changed = "" if self.answer is None else _changed(self.answer, answer)
        now = time.perf_counter()
        if self.answer is not None and not (changed == key and now - when < GESTURE):
            self._before = self.answer
        self._gesture, self.answer = (changed, now), answer
        self._time = min(self._time, answer.end)
        self._publish()

    # Its display -----------------------------------------------------------------------------

    @property
    def _other(self) -> Answer | None:
        """The answer in gray."""
        found = {BEFORE: self._before, WRITTEN: self._as_written}.get(self._ghost.value)
        return None if found is None or self.answer is None or found.values == self.answer.values else found

    def _publish(self) -> None:
        """Send the answer to the page."""
        assert self.answer is not None
        self._draw(self.answer, self._other)
        _set(self._clock, "max", self.answer.end)
        with self._client.atomic():
            self._picture.at(self.answer, self._other, self._time)
        self._tell_time()

    def _draw(self, answer: Answer, other: Answer | None) -> None:
        """Draw the plots and metrics of an answer, and its lines in the picture."""
        self._is_redrawn = False
        beside: Run | None = None if other is None else other.run
        drawn = plots.plots(
            answer.run, beside, dark=self._dark.value, with_plain=self._plain.value,
            seconds=None if self.drag is None else RECENT,
        )  # fmt: skip
        with self._client.atomic():
            for (name, chart), plot in zip(self._charts, drawn, strict=True):
                for prop in ("series", "scales", "axes"):
                    if getattr(chart, prop) != getattr(plot, prop):
                        setattr(chart, prop, getattr(plot, prop))
                chart.data = plot.data
                _set(name, "content", plots.key(plot))
        self._client.flush()  # the page shows the curves before the rest is computed
        with self._client.atomic():
            self._figures.content = plots.table(answer.run, beside, self._ghost.value)
            self._block.content = _copied(saving.control_block(answer))
            read = read_of(self._written, answer.values)
            for key, handle in self._handles.items():
                _set(handle, "visible", key in read)
            self._picture.show(answer, other)
            if self.drag is not None:
                _set(self._strip, "content", plots.strip(answer.run, answer.end, RECENT))

    def _tell_time(self) -> None:
        assert self.answer is not None
        self._clock.value = min(round(self._time, 3), self.answer.end)
        _set(self._strip, "content", plots.strip(self.answer.run, self._time, self.answer.end))

    def _say(self, text: str, *, is_wrong: bool = False) -> None:
        color = ";color:#ff2d2d;font-weight:bold" if is_wrong else ""
        # the number of answers tells others, such as a test, that this one belongs to the latest setting
        told = f'<div data-answers="{self._answers}" style="font-size:.8em;padding:.2em .5em{color}">'
        told += f"{html.escape(text)}</div>"
        _set(self._said, "content", told)

    # Its layout ------------------------------------------------------------------------------

    def _build(self, explored: Explored) -> None:
        """Lay the page out: settings on the left, the arm in the middle, plots on the right."""
        gui, self._as_written, self.controls = self._client.gui, explored.written, explored.controls
        self._written = {one.key: one.written for one in explored.controls}
        marks = Lesson.model_fields["shows"].default if self._lesson is None else self._lesson.shows
        self._picture = Picture(self._client.scene, marks)
        self._client.scene.configure_default_lights(cast_shadow=False)
        gui.main_panel.dock_left()
        gui.main_panel.set_width(SETTINGS)
        self._said = gui.add_html("")
        self._mode = gui.add_dropdown(
            "mode", (RUN, DRAG), initial_value=DRAG if self._drags else RUN,
            hint="run: the scenario, again at each change; drag: you lead the arm, in real time",
        )  # fmt: skip
        self._mode.on_update(self._choose_mode)
        self._build_clock()
        self._hand = Hand(
            self._client, explored.written.prepared, explored.written.scene.reach, self._wake.set
        )
        tabs = gui.add_tab_group()
        if self._lesson is not None:
            with tabs.add_tab("Lesson"):
                self._build_lesson(self._lesson)
        with tabs.add_tab("Settings"):
            self._build_settings()
        with tabs.add_tab("Show"):
            self._build_looks()
        with tabs.add_tab("Take along"):
            self._build_saving()
            gui.add_markdown(rows.links(self._as_written.prepared.scenario.name))
        gui.add_html(EXTRAS)
        self._build_plots()
        camera = self._client.camera
        self._before_docking = camera.image_width / max(camera.image_height, 1)
        self._aspect = (camera.image_width - SETTINGS - PLOTS) / max(camera.image_height, 1)
        self._aim()
        camera.on_update(self._fit)

    def _choose_mode(self, event: Any) -> None:
        if event.client is not None:
            self._drags = self._mode.value == DRAG
            self._wake.set()

    def _build_clock(self) -> None:
        gui, end = self._client.gui, self._as_written.end
        self._player = gui.add_button("Play", hint="key P")
        self._player.on_click(lambda _: self._play(not self._plays))
        gui.add_command("Play or pause", hotkey="P").on_trigger(lambda _: self._play(not self._plays))
        self._clock = gui.add_slider("time", 0.0, end, 0.001, 0.0, hint="of the run [s]")
        self._clock.on_update(self._scrub)

    def _scrub(self, event: Any) -> None:
        if event.client is not None:  # the reader moved it, not this session
            self._time = self._clock.value
            self._wake.set()

    def _play(self, plays: bool) -> None:
        if plays and self.answer is not None and self._time >= self.answer.end:
            self._time = 0.0
        self._plays = plays
        self._player.label = "Pause" if plays else "Play"
        self._wake.set()

    def _build_lesson(self, lesson: Lesson) -> None:
        gui = self._client.gui
        asked = [f"{i}. **{one.ask}** {one.do}" for i, one in enumerate(lesson.questions, 1)]
        sought = lesson.number
        gui.add_markdown(
            "\n\n".join([f"**{lesson.title}.** {lesson.about}", *asked, f"**Find.** {sought.ask}"])
        )
        found = gui.add_text(f"in {sought.unit}" if sought.unit != "1" else "number", "")
        told = gui.add_markdown("")

        def check(_: Any) -> None:
            is_right = sought.is_met(found.value)
            told.content = "" if is_right is None else "**Right.**" if is_right else "Not yet."

        gui.add_button("Check").on_click(check)
        gui.add_markdown(rows.links(lesson.scenario, lesson.rows))

    def _build_settings(self) -> None:
        gui = self._client.gui
        self._handles: dict[str, Any] = {}
        for section, some in groupby(self.controls, key=lambda one: one.section):
            with gui.add_folder(section):
                for one in some:
                    handle = self._handles[one.key] = _made(gui, one)
                    handle.on_update(partial(self._change, one))
        gui.add_button("Back to as written", hint="key B").on_click(self._reset)
        gui.add_command("Back to as written", hotkey="B").on_trigger(self._reset)

    def _change(self, control: Control, event: Any) -> None:
        """Take the value of a control; the value as written is no change."""
        if event.client is None:
            return
        value = control.parsed(self._handles[control.key].value)
        with self._asking():
            if value == control.written:
                self._values.pop(control.key, None)
            else:
                self._values[control.key] = value

    def _reset(self, _: Any) -> None:
        for key, handle in self._handles.items():
            handle.value = self._written[key]
        with self._asking():
            self._values.clear()

    @contextmanager
    def _asking(self) -> Iterator[None]:
        """Run the scenario again with the changes of the block.

        A short run may end first, so that the page follows a dragged slider. A long run is stopped.
        """
        with self._lock:
            yield
            self._is_asked = True
            if time.perf_counter() - self._began > LONG:
                self._stop.set()
        self._wake.set()

    def _build_looks(self) -> None:
        gui = self._client.gui
        self._ghost = gui.add_dropdown("beside it", (BEFORE, WRITTEN, NOTHING), initial_value=BEFORE)
        self._plain = gui.add_checkbox("plain inverse", True, hint="its rates, dashed")
        self._dark = gui.add_checkbox("dark", False)
        for handle in (self._ghost, self._plain, self._dark):
            handle.on_update(self._look)
        for mark, name in MARKS.items():
            gui.add_checkbox(name, mark in self._picture.marks).on_update(partial(self._mark, mark))
        loops = gui.add_checkbox("loop", self._loops)
        loops.on_update(lambda event: setattr(self, "_loops", event.target.value))
        speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value="1")
        speed.on_update(lambda event: setattr(self, "_speed", SPEEDS[event.target.value]))

    def _look(self, _: Any) -> None:
        self._client.gui.configure_theme(show_logo=False, show_share_button=False, dark_mode=self._dark.value)
        self._is_redrawn = True
        self._wake.set()

    def _mark(self, mark: str, event: Any) -> None:
        others = self._picture.marks - {mark}
        self._picture.marks = others | {mark} if event.target.value else others
        self._wake.set()

    def _build_saving(self) -> None:
        gui = self._client.gui
        button = gui.add_button("Save as scenario", hint=f"NAME{saving.SUFFIX}.yaml and .npz in {self._out}")
        self._saved = gui.add_markdown("")
        button.on_click(self._ask_to_save)
        self._block = gui.add_html("")

    def _ask_to_save(self, _: Any) -> None:
        self._is_saved = True
        self._wake.set()

    def _save(self, explored: Explored) -> None:
        """Save the answer to the latest setting, which drag mode has not run yet."""
        self._is_saved = False
        assert self.answer is not None
        try:
            if self.drag is not None and self.drag.values != self.answer.values:
                with self._lock:
                    self._stop, self._began = threading.Event(), time.perf_counter()
                    if self._closed:
                        self._stop.set()
                answer = explored.answer(self.drag.values, self._stop)
                if answer is None:
                    return
                self.answer = answer
            scenario, columns = saving.save(self.answer, self._out)
        except OSError as error:
            self._say(f"{error.filename}: {(error.strerror or str(error)).lower()}", is_wrong=True)
            return
        except RmrcError as error:
            self._say(str(error).splitlines()[0], is_wrong=True)
            return
        run, tune = command("run", scenario), command("tune", scenario)
        self._saved.content = f"Saved `{scenario}` and `{columns.name}`.\n```\n{run}\n{tune}\n```"

    def _build_plots(self) -> None:
        gui = self._client.gui
        panel = gui.add_panel()
        panel.dock_right()
        panel.set_width(PLOTS)
        self._charts = []
        drawn = plots.plots(self._as_written.run, None, dark=False, with_plain=True)
        with panel.add_tab("Plots"):
            for plot in drawn:
                name = gui.add_html(plots.key(plot))
                chart = gui.add_uplot(
                    plot.data, plot.series, scales=plot.scales, axes=plot.axes, height=HEIGHT,
                    legend={"show": False}, cursor={"sync": {"key": "time"}}, padding=(8, 16, 0, 0),
                )  # fmt: skip
                self._charts.append((name, chart))
            self._strip = gui.add_html("")
        with panel.add_tab("Figures"):
            self._figures = gui.add_html("")

    def _fit(self, camera: Any) -> None:
        """Aim again if the room between the panels has another shape."""
        aspect = camera.image_width / max(camera.image_height, 1)
        if aspect != self._before_docking and not math.isclose(aspect, self._aspect, rel_tol=0.05):
            self._aspect, self._is_fitted = aspect, False
            self._wake.set()

    def _aim(self) -> None:
        """Turn the camera to the whole run, and in drag mode to the gizmo too."""
        self._is_fitted = True
        room = ROOM if self.drag is None else GIZMO + PULL
        seen = view(self._as_written, max(ASPECT, self._aspect), self._picture.marks, room)
        camera = self._client.camera
        camera.up_direction, camera.fov = seen.up, seen.fov
        camera.position, camera.look_at = seen.position, seen.look_at


def _made(gui: Any, one: Control) -> Any:
    """Return the handle of a control."""
    if one.options:
        return gui.add_dropdown(one.label, one.options, initial_value=one.written, hint=one.hint)
    if isinstance(one.written, bool):
        return gui.add_checkbox(one.label, one.written, hint=one.hint)
    return gui.add_slider(one.label, one.low, one.high, one.step, one.written, hint=one.hint)


def _set(handle: Any, prop: str, value: object) -> None:
    """Set a property if its value differs: the page needs no message otherwise."""
    if getattr(handle, prop) != value:
        setattr(handle, prop, value)


def _changed(old: Answer, new: Answer) -> str:
    """Return the one key in which two settings differ, or all of them."""
    keys = {key for key in {*old.values, *new.values} if old.values.get(key) != new.values.get(key)}
    return " ".join(sorted(keys))


def _copied(text: str) -> str:
    """Return a text with a button that copies it, as HTML; a page without a clipboard selects it."""
    script = (
        "const t=this.nextElementSibling;navigator.clipboard?navigator.clipboard.writeText(t.textContent)"
        ":getSelection().selectAllChildren(t)"
    )
    return (
        f'<div style="padding:.3em .5em"><button style="font:inherit;cursor:pointer" onclick="{script}">'
        f'Copy control block</button><pre style="font-size:.75em;overflow-x:auto">{html.escape(text)}</pre>'
        "</div>"
    )
