// The page: settings, curves and figures of the run, time, and a goal that follows the pointer.

const element = (id) => document.getElementById(id);
const on = (id, type, act) => element(id)?.addEventListener(type, act);
const unpacked = (id) => {
  const packed = new Blob([bytesOf(element(id).textContent)]);
  return new Response(packed.stream().pipeThrough(new DecompressionStream("deflate")));
};

const data = await unpacked("scenario").json();
const world = new World(await WebAssembly.compile(await unpacked("law").arrayBuffer()), data.image);
const { period, joints, drawing, written } = data;
const settings = new Settings(data);
const view = new View(element("arm"), drawing);
const inputs = settings.controls.map((_, i) => element(`control-${i}`));
const moves = drawing.rows.filter((row) => row < 3);
const turns = drawing.rows.filter((row) => row > 2);
// Ticks that are plotted at most; the step of a key, as a part of the reach; seconds of a trail behind a dragged goal.
const PLOTTED = 6000;
const STEP = 0.02;
const TRAIL = 3;
let run;
let now = 0;
let isPlaying = false;
let goal = null;

const paint = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const shown = (value) =>
  typeof value === "number" ? String(+value.toPrecision(4)) : value ? "by joint" : "none";
const clipped = (value, low, high) => Math.min(Math.max(value, low), high);
const isWritten = () => Object.keys(settings.changes).length === 0;
const timeAt = (k) => run.number("time", k);
const tickNow = () => (goal ? run.count - 1 : clipped(Math.round(now / period), 0, run.count - 1));
const ticksBy = (step) => Array.from({ length: Math.ceil(run.count / step) }, (_, i) => i * step);
const least = (k) => run.number("sigma", k, data.image.columns.sigma[1] - 1);
const error = (rows) => (k) => 1e3 * Math.hypot(...rows.map((i) => run.number("pose_error", k, i)));
const largest = (values) => values.reduce((most, value) => Math.max(most, Math.abs(value) || 0), 0);
const peak = (value) => largest(ticksBy(1).map(value));

// Settings ---------------------------------------------------------------------------------------

function showSettings() {
  settings.controls.forEach((control, i) => {
    const value = settings.value(control.key);
    const text = `${shown(value)} ${typeof value === "number" ? control.unit : ""}`;
    const row = inputs[i].parentElement;
    row.hidden = !settings.isRead(control.key);
    row.classList.toggle("changed", settings.chosen[i] !== control.start);
    inputs[i].value = settings.chosen[i];
    if (inputs[i].type !== "range") return;
    inputs[i].setAttribute("aria-valuetext", text);
    row.querySelector("output").textContent = text;
  });
  element("yaml").textContent = settings.yaml;
  element("copy").textContent = "Copy as scenario";
  history.replaceState(null, "", `#${new URLSearchParams(settings.changes)}`);
}

// Curves and figures -----------------------------------------------------------------------------

const curve = (label, color, value, dash) => ({ label, color, value, dash, width: dash ? 1 : 1.5 });
const errors = [
  { name: "position_error", title: "Position error", unit: "mm", rows: moves, color: HUE.gold },
  { name: "orientation_error", title: "Rotation error", unit: "mrad", rows: turns, color: HUE.teal },
].filter(({ rows }) => rows.length);
let plain = 0; // the joint that the plain inverse moves fastest
const panels = [
  {
    name: "rates",
    title: `Rates commanded [${data.unit}]`,
    limits: () => [...new Set(run.row("limit", 0))].flatMap((limit) => [limit, -limit]),
    curves: [
      ...joints.map(({ name, color }, j) => curve(name, color, (k) => run.number("qdot_cmd", k, j))),
      curve("plain inverse, one joint", GRAY, (k) => run.number("qdot_plain", k, plain), [2, 2]),
    ],
  },
  {
    name: "sigma",
    title: "σ_min and damping λ",
    logarithmic: true,
    limits: () => [settings.value("control.inverse.damping.below", data.below)],
    curves: [
      curve("σ_min", HUE.green, (k) => Math.max(least(k), 1e-6)),
      curve("λ", "#b4289b", (k) => run.number("damping", k) || null, [5, 2]),
    ],
  },
  ...errors.map(({ name, title, unit, rows, color }) => ({
    name,
    title: `${title} [${unit}]`,
    curves: [curve("error", color, error(rows))],
  })),
  { title: "Status", curves: [] },
];
if (written) {
  const times = floats(written.time);
  for (const { name, curves } of panels.slice(0, -1)) {
    const label = `MuJoCo as written${name === "rates" ? `, ${written.joint}` : ""}`;
    const values = floats(written[name]);
    let i = 0;
    const value = (k) => {
      const time = timeAt(k) + period / 2;
      if (time < times[i]) i = 0;
      while (times[i + 1] <= time) i++; // a value holds until the next
      return goal || time > times.at(-1) + period ? null : values[i];
    };
    curves.push(curve(label, () => (isWritten() ? paint("--ink") : GRAY), value, [6, 3]));
  }
}

// Begin and end of each time with a status.
function spans(bit) {
  const all = [];
  for (const k of ticksBy(1).filter((k) => run.status(k) & bit)) {
    if (all.at(-1)?.[1] >= timeAt(k) - 1e-9) all.at(-1)[1] = timeAt(k) + period;
    else all.push([timeAt(k), timeAt(k) + period]);
  }
  return all;
}

// Ends of the axis of a panel.
function range({ curves, logarithmic }) {
  const drawn = curves.filter(({ color }) => color !== GRAY).flatMap(({ values }) => values);
  const values = drawn.filter(Number.isFinite);
  const power = (value) => 10 ** Math.ceil(Math.log10(value) + 1e-9);
  if (logarithmic) return [1 / power(largest(values.map((value) => 1 / value))), power(largest(values))];
  const most = Math.max(1e-3, 1.2 * largest(values));
  return [values.some((value) => value < 0) ? -most : 0, most];
}

function showPanels() {
  const ticks = ticksBy(Math.ceil(run.count / PLOTTED));
  const time = ticks.map(timeAt);
  const rates = joints.map((_, j) => peak((k) => run.number("qdot_plain", k, j)));
  plain = rates.indexOf(Math.max(...rates));
  for (const panel of panels) {
    for (const curve of panel.curves) curve.values = ticks.map(curve.value);
    const states = panel.curves.length
      ? []
      : data.statuses.map((state) => ({ ...state, spans: spans(state.bit) }));
    const lanes = states.filter((lane) => lane.spans.length);
    const levels = panel.limits?.().map((value) => ({ value, color: GRAY })) ?? [];
    const isDrawn = panel.lanes?.length === lanes.length;
    Object.assign(panel, { time, lanes, levels, range: range(panel) });
    if (isDrawn) {
      const rows = panel.curves.length ? panel.curves.map(({ values }) => values) : [time.map(() => null)];
      panel.plot.setData([time, ...rows]);
    } else drawAnew(panel);
  }
  const figures = errors.map(({ name, unit, rows }) => `${name}.max ${shown(peak(error(rows)))} ${unit}`);
  const rate = shown(peak((k) => largest(run.row("qdot_cmd", k))));
  figures.push(
    `joint_rate_cmd.peak ${rate} ${data.unit}`,
    `sigma.min ${shown(1 / peak((k) => 1 / least(k)))}`,
  );
  element("figures").textContent = `${figures.join(", ")}${run.isDiverged ? "; it diverged" : ""}`;
}

function drawAnew(panel) {
  panel.plot?.destroy();
  panel.place ??= element("plots").appendChild(document.createElement("div"));
  panel.place.innerHTML = `<h2>${panel.title}</h2>`;
  panel.place.hidden = panel.curves.length + panel.lanes.length === 0;
  panel.height = panel.curves.length ? 150 : undefined;
  panel.plot = drawPanel(panel, panel.place);
  panel.line = panel.plot.over.appendChild(document.createElement("div"));
  panel.line.className = "now";
}

// The picture ------------------------------------------------------------------------------------

const marks = [...document.querySelectorAll("#marks input")];
for (const mark of marks) {
  mark.checked = data.shows.includes(mark.value);
  mark.addEventListener("change", show);
}
const skeletons = written && points(written.skeletons);

// The joints of the run that MuJoCo made, and its site.
function ghost(time) {
  if (!written || goal) return [];
  const size = drawing.axes.length + 1;
  const i = size * Math.round(clipped(time / written.end, 0, 1) * (skeletons.length / size - 1));
  return skeletons.slice(i, i + size);
}

function show() {
  const k = tickNow();
  const time = timeAt(k);
  const first = goal ? Math.max(0, k - Math.round(TRAIL / period)) : 0;
  const trail = ticksBy(Math.max(1, Math.round((k - first) / 300)));
  const seen = {
    trail: [...trail.filter((i) => first <= i && i < k), k],
    near: (i) => 1 - clipped(least(i) / data.below, 0, 1),
    ghost: ghost(time),
    marks: new Set(marks.filter((mark) => mark.checked).map((mark) => mark.value)),
  };
  const [ink, line, paper] = ["--ink", "--line", "--paper"].map(paint);
  view.draw(run, k, seen, {
    ink,
    line,
    paper,
    goal: goal ? HUE.red : ink,
    ghost: isWritten() ? "#2f7fe866" : `${GRAY}66`,
  });
  element("time").value = time;
  element("clock").textContent = `${time.toFixed(2)} s`;
  for (const { plot, line } of panels) line.style.left = `${plot.valToPos(time, "x")}px`;
}

// Time, and the goal -----------------------------------------------------------------------------

function play(starts) {
  const end = timeAt(run.count - 1);
  let before = performance.now();
  isPlaying = starts;
  element("play").textContent = starts ? "Pause" : "Play";
  if (starts && now >= end) now = 0;
  const next = (clock) => {
    if (!isPlaying) return;
    now = clipped(now + (clock - before) / 1e3, 0, end);
    before = clock;
    show();
    if (now < end) requestAnimationFrame(next);
    else play(false);
  };
  if (starts) requestAnimationFrame(next);
}

// Have the law follow a goal in real time, from where the arm is.
function drag() {
  const [q, pose] = ["q", "pose"].map((name) => [...run.row(name, tickNow())]);
  const follow = world.follower(settings.effects, q);
  const mine = (goal = [...(goal ?? pose)]);
  let before = performance.now();
  let frames = 0;
  const next = (clock) => {
    if (goal !== mine) return;
    run = follow(goal, clipped(Math.round((clock - before) / 1e3 / period), 1, Math.ceil(0.05 / period)));
    before = clock;
    if (frames++ % 6 === 0) showPanels();
    show();
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
}

const move = (to) => goal.splice(0, 3, ...to.slice(0, 3));

function turn(sideways, upwards) {
  view.azimuth += sideways;
  view.elevation = clipped(view.elevation + upwards, -1.5, 1.5);
  show();
}

on("arm", "pointerdown", (event) => view.canvas.setPointerCapture(event.pointerId));
on("arm", "pointermove", (event) => {
  if (goal && (event.buttons || drawing.screen)) move(view.unproject(event.offsetX, event.offsetY, goal));
  else if (event.buttons) turn(-event.movementX / 150, event.movementY / 150);
});
on("arm", "keydown", (event) => {
  const keys = ["ArrowLeft", "ArrowRight", "ArrowDown", "ArrowUp", "PageDown", "PageUp"];
  const number = keys.indexOf(event.key);
  if (number < 0) return;
  event.preventDefault();
  const axis = Math.floor(number / 2);
  const side = 2 * (number % 2) - 1;
  if (goal) move(along(goal, view.axes[axis], side * STEP * drawing.reach));
  else turn(axis === 0 ? -0.1 * side : 0, axis === 1 ? 0.1 * side : 0);
});

// All together -----------------------------------------------------------------------------------

function rerun() {
  showSettings();
  if (goal) return drag();
  run = world.run(settings.path, settings.effects, settings.ticks);
  element("time").max = timeAt(run.count - 1);
  showPanels();
  show();
}

let isDue = false;
function changed() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    const before = performance.now();
    rerun();
    document.body.dataset.redrawn = Math.round(performance.now() - before);
  });
}

function read(address) {
  settings.read(address);
  changed();
}

inputs.forEach((input, i) =>
  input.addEventListener("input", () => {
    settings.choose(i, Number(input.value));
    changed();
  }),
);
on("play", "click", () => play(!isPlaying));
on("time", "input", () => {
  play(false);
  now = element("time").valueAsNumber;
  show();
});
on("drag", "click", () => {
  play(false);
  if (goal) changed();
  goal ? (goal = null) : drag();
  element("drag").setAttribute("aria-pressed", goal !== null);
  document.body.classList.toggle("dragged", goal !== null);
});
on("reset", "click", () => read(""));
on("answer", "change", () => {
  const isRight = Math.abs(element("answer").valueAsNumber - data.lesson.value) <= data.lesson.within;
  element("verdict").textContent = isRight ? "Right." : "Not yet.";
});
addEventListener("hashchange", () => read(location.hash.slice(1)));
addEventListener("resize", show);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const panel of panels) panel.lanes = null;
  changed();
});
read(location.hash.slice(1));
