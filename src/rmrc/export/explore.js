// The page: settings, curves and figures of the run, time, and a goal that follows the pointer.

const element = (id) => document.getElementById(id);
async function unpacked(id) {
  const packed = bytesOf(element(id).textContent);
  return new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate")));
}

const data = await (await unpacked("scenario")).json(),
  { period, joints, drawing, written } = data;
const course = new Course(await WebAssembly.compile(await (await unpacked("law")).arrayBuffer()), data);
const settings = new Settings(data),
  view = new View(element("arm"), drawing);
const inputs = settings.controls.map((_, i) => element(`control-${i}`));
const moves = drawing.rows.filter((row) => row < 3),
  turns = drawing.rows.filter((row) => row > 2);
// Ticks that are plotted at most; the step of a key, as a part of the reach; seconds of a trail behind a dragged goal.
const PLOTTED = 2500,
  STEP = 0.02,
  TRAIL = 3,
  GRAY = "#949494";
let run,
  now = 0,
  started = null,
  goal = null;

const paint = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const shown = (value) =>
  typeof value === "number" ? String(+value.toPrecision(4)) : value?.length ? "by joint" : "none";
const clipped = (value, low, high) => Math.min(Math.max(value, low), high);
const timeAt = (k) => run.number("time", k),
  least = (k) => run.number("sigma", k, data.image.columns.sigma[1] - 1);
const fastest = (k) =>
  joints.reduce((most, _, j) => Math.max(most, Math.abs(run.number("qdot_cmd", k, j))), 0);
const error = (k, rows) =>
  1e3 * Math.sqrt(rows.reduce((sum, i) => sum + run.number("pose_error", k, i) ** 2, 0));
const largest = (values) => values.reduce((most, value) => (value > most ? value : most), 0);

// The largest of a quantity over all ticks.
function peak(value) {
  let most = 0;
  for (let k = 0; k < run.count; k++) most = Math.max(most, value(k) || 0);
  return most;
}

// Settings ---------------------------------------------------------------------------------------

function showSettings() {
  settings.controls.forEach((control, i) => {
    const value = settings.value(control.key),
      row = inputs[i].parentElement;
    const isModels = control.key === "control.limits.rate" && value === null;
    const text = isModels ? "model's" : `${shown(value)} ${typeof value === "number" ? control.unit : ""}`;
    row.hidden = !settings.isRead(control);
    row.classList.toggle("changed", settings.chosen[i] !== control.start);
    inputs[i].value = settings.chosen[i];
    if (inputs[i].type !== "range") return;
    inputs[i].setAttribute("aria-valuetext", text);
    row.querySelector("output").textContent = text;
  });
  element("reset").disabled = settings.isWritten;
  element("yaml").textContent = settings.yaml;
  history.replaceState(null, "", `#${new URLSearchParams(settings.changes)}`);
}

// Curves and figures -----------------------------------------------------------------------------

// The curve of the run that MuJoCo made, at some times: each value holds until the next.
function beside(name, times) {
  const time = floats(written.time),
    values = floats(written[name]);
  const label = `MuJoCo${settings.isWritten ? "" : ", as written"}${name === "rates" ? `, ${written.joint}` : ""}`;
  let k = 0;
  const held = times.map((t) => {
    while (k + 1 < time.length && time[k + 1] <= t + 1e-9) k++;
    return t > time.at(-1) + 1e-9 ? null : values[k];
  });
  return { label, color: settings.isWritten ? paint("--ink") : GRAY, width: 1, dash: [6, 3], values: held };
}

function panels() {
  const step = Math.ceil(run.count / PLOTTED);
  const shownTicks = Array.from({ length: Math.floor((run.count - 1) / step) + 1 }, (_, i) => i * step),
    time = shownTicks.map(timeAt),
    all = [];
  const curve = (label, color, value, more) => ({
    label,
    color,
    width: 1.5,
    values: shownTicks.map(value),
    ...more,
  });
  const add = (id, title, curves, range, more) => {
    const beyond = written && !goal ? [beside(id, time)] : [];
    const values = [...curves, ...beyond].filter((each) => !each.isPlain).flatMap((each) => each.values);
    const panel = { id, title, time, curves: [...curves, ...beyond], levels: [], lanes: [], height: 150 };
    all.push({ ...panel, range: range(values.filter(Number.isFinite)), ...more });
  };
  const plain = joints.map((_, j) => peak((k) => Math.abs(run.number("qdot_plain", k, j))));
  const j = plain.indexOf(Math.max(...plain)),
    limits = [...new Set(run.row("limit", 0))];
  add(
    "rates",
    `Rates commanded [${data.unit}]`,
    [
      ...joints.map(({ name, color }, i) => curve(name, color, (k) => run.number("qdot_cmd", k, i))),
      curve(`plain inverse, ${joints[j].name}`, "#808890", (k) => run.number("qdot_plain", k, j), {
        dash: [2, 2],
        isPlain: true,
      }),
    ],
    (values) => [-1.2, 1.2].map((part) => part * Math.max(1e-3, largest(values.map(Math.abs)))),
    {
      levels: limits.flatMap((limit) => [limit, -limit]).map((value) => ({ value, color: GRAY })),
    },
  );
  const powers = (values) => [
    Math.floor(Math.log10(1 / largest(values.map((x) => 1 / x)))),
    Math.ceil(Math.log10(largest(values)) + 1e-9),
  ];
  add(
    "sigma",
    "σ_min and damping λ",
    [
      curve("σ_min", "#1e9650", (k) => Math.max(least(k), 1e-6)),
      curve("λ", "#b4289b", (k) => run.number("damping", k) || null, { dash: [5, 2] }),
    ],
    (values) => powers(values).map((power) => 10 ** power),
    {
      logarithmic: true,
      levels: [{ value: settings.value("control.inverse.damping.below", data.below), color: GRAY }],
    },
  );
  const bounds = (values) => [0, 1.1 * Math.max(1e-3, largest(values))];
  if (moves.length)
    add("error", "Position error [mm]", [curve("error", "#b08a00", (k) => error(k, moves))], bounds);
  if (turns.length)
    add("turn", "Rotation error [mrad]", [curve("error", "#00809c", (k) => error(k, turns))], bounds);
  const lanes = data.statuses
    .map((status) => ({ ...status, spans: spans(status.bit) }))
    .filter((lane) => lane.spans.length);
  if (lanes.length)
    all.push({ id: "status", title: "Status", time, curves: [], levels: [], lanes, range: [0, 1] });
  return all;
}

// Begin and end of each time with a status.
function spans(bit) {
  const found = [];
  for (let k = 0; k < run.count; k++) {
    if (!(run.status(k) & bit)) continue;
    const time = timeAt(k);
    if (found.length && found.at(-1)[1] >= time - 1e-9) found.at(-1)[1] = time + period;
    else found.push([time, time + period]);
  }
  return found;
}

// Plots are made anew where their curves have other names.
const plots = new Map();
function showPanels() {
  const all = panels(),
    names = ({ id, curves, lanes }) =>
      [id, ...[...curves, ...lanes].map((each) => each.label ?? each.name)].join();
  for (const [key, { plot, place }] of plots) {
    if (all.some((panel) => names(panel) === key)) continue;
    plot.destroy();
    place.remove();
    plots.delete(key);
  }
  for (const panel of all) {
    const old = plots.get(names(panel));
    if (old) {
      Object.assign(old.panel, panel);
      old.plot.setData([
        panel.time,
        ...panel.curves.map((each) => each.values),
        ...(panel.lanes.length ? [panel.time.map(() => null)] : []),
      ]);
    } else {
      const place = document.createElement("div"),
        line = document.createElement("div");
      place.append(Object.assign(document.createElement("h2"), { textContent: panel.title }));
      place.style.order = all.indexOf(panel);
      line.className = "now";
      const plot = drawPanel(panel, element("plots").appendChild(place));
      plot.over.append(line);
      plots.set(names(panel), { panel, plot, place, line });
    }
  }
}

function showFigures() {
  const last = run.count - 1,
    table = {
      "joint_rate_cmd.peak": [peak(fastest), data.unit],
      duration: [timeAt(last), "s"],
      "sigma.min": [1 / peak((k) => 1 / least(k)), ""],
      "damping.max": [peak((k) => run.number("damping", k)), ""],
    };
  for (const [name, rows, unit] of [
    ["position_error", moves, "mm"],
    ["orientation_error", turns, "mrad"],
  ]) {
    if (!rows.length) continue;
    table[`${name}.max`] = [peak((k) => error(k, rows)), unit];
    table[`${name}.end`] = [error(last, rows), unit];
  }
  element("table").innerHTML = Object.entries(table)
    .map(
      ([name, [value, unit]]) =>
        `<tr><th scope="row">${name}</th><td>${shown(value)}</td><td class="word">${unit}</td></tr>`,
    )
    .join("");
  const [rate, far] = [
    table["joint_rate_cmd.peak"],
    table["position_error.max"] ?? table["orientation_error.max"],
  ];
  element("summary").textContent =
    `Largest rate ${shown(rate[0])} ${rate[1]}, largest error ${shown(far[0])} ${far[1]}.${run.isDiverged ? " It diverged." : ""}`;
}

// The picture ------------------------------------------------------------------------------------

const marks = [...document.querySelectorAll("#marks input")];
for (const mark of marks) {
  mark.checked = data.shows.includes(mark.value);
  mark.addEventListener("change", show);
}

function ghost(time) {
  if (!written || goal) return null;
  const all = points(written.skeleton.points),
    count = drawing.axes.length + 1,
    last = all.length / count - 1;
  const i = Math.round(clipped(time / floats(written.skeleton.time)[last], 0, 1) * last);
  return all.slice(i * count, (i + 1) * count);
}

function show() {
  const k = goal ? run.count - 1 : clipped(Math.round(now / period), 0, run.count - 1),
    time = timeAt(k);
  const first = goal ? Math.max(0, k - Math.round(TRAIL / period)) : 0,
    step = Math.max(1, Math.round((k - first) / 300));
  const trail = Array.from({ length: Math.floor((k - first) / step) + 1 }, (_, i) => k - i * step).reverse();
  const [tip, lost] = ["pose", "u_min"].map((name) => run.row(name, k));
  const ink = Object.fromEntries(["ink", "line", "paper"].map((name) => [name, paint(`--${name}`)]));
  view.draw(
    {
      frames: run.row("frame", k),
      J: run.row("J", k),
      target: run.row("pose_ref", k),
      tip,
      lost,
      ghost: ghost(time),
      frame: { world: null, base: drawing.base, site: tip }[drawing.frame],
      isHeld: goal !== null,
      trail: trail.map((i) => run.row("pose", i)),
      near: trail.map((i) => 1 - clipped(least(i) / data.below, 0, 1)),
      marks: new Set(marks.filter((mark) => mark.checked).map((mark) => mark.value)),
    },
    { ...ink, ghost: settings.isWritten ? "#2f7fe866" : `${GRAY}66` },
  );
  element("time").value = time;
  element("clock").textContent = `${time.toFixed(2)} s`;
  for (const { plot, line } of plots.values()) line.style.left = `${plot.valToPos(time, "x")}px`;
}

// Time, and the goal -----------------------------------------------------------------------------

function play(starts) {
  started = starts ? performance.now() - 1e3 * (now >= timeAt(run.count - 1) ? 0 : now) : null;
  element("play").textContent = starts ? "Pause" : "Play";
  if (starts) requestAnimationFrame(advance);
}

function advance(clock) {
  if (started === null) return;
  now = clipped((clock - started) / 1e3, 0, timeAt(run.count - 1));
  show();
  if (now < timeAt(run.count - 1)) requestAnimationFrame(advance);
  else play(false);
}

// Have the law follow a goal in real time, from where the arm is.
function drag() {
  const k = goal ? run.count - 1 : clipped(Math.round(now / period), 0, run.count - 1);
  const follow = course.follower(settings, run.row("q", k)),
    own = (goal = [...(goal ?? run.row("pose", k))]);
  let before = performance.now(),
    frames = 0;
  const next = (clock) => {
    if (goal !== own) return;
    const count = clipped(Math.round((clock - before) / 1e3 / period), 1, Math.ceil(0.05 / period));
    before = clock;
    run = follow(goal, count);
    if (frames++ % 6 === 0) {
      showPanels();
      showFigures();
    }
    show();
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
}

function move(to) {
  if (goal) goal.splice(0, 3, ...to);
}

function turn(sideways, upwards) {
  view.azimuth += sideways;
  view.elevation = clipped(view.elevation + upwards, -1.5, 1.5);
  if (!goal) show();
}

let held = null;
view.canvas.addEventListener("pointerdown", (event) => {
  held = event;
  view.canvas.setPointerCapture(event.pointerId);
});
view.canvas.addEventListener("pointerup", () => {
  held = null;
});
view.canvas.addEventListener("pointermove", (event) => {
  if (goal && (held || drawing.screen)) move(view.unproject(event.offsetX, event.offsetY, goal));
  else if (held) turn((held.offsetX - event.offsetX) / 150, (event.offsetY - held.offsetY) / 150);
  held = held && event;
});
view.canvas.addEventListener("keydown", (event) => {
  const keys = [
    ["ArrowLeft", "ArrowRight"],
    ["ArrowDown", "ArrowUp"],
    ["PageDown", "PageUp"],
  ];
  const i = keys.findIndex((pair) => pair.includes(event.key)),
    side = event.key === keys[i]?.[1] ? 1 : -1;
  if (i < 0) return;
  event.preventDefault();
  if (goal) move(along(goal, view.axes[i], side * STEP * drawing.reach));
  else turn(i === 0 ? -0.1 * side : 0, i === 1 ? 0.1 * side : 0);
});

// All together -----------------------------------------------------------------------------------

function rerun() {
  showSettings();
  if (goal) return drag();
  run = course.run(settings);
  element("time").max = timeAt(run.count - 1);
  showPanels();
  showFigures();
  show();
}

let isDue = false;
function changed() {
  if (!isDue)
    requestAnimationFrame(() => {
      isDue = false;
      const before = performance.now();
      rerun();
      document.body.dataset.redrawn = Math.round(performance.now() - before);
    });
  isDue = true;
}

const on = (id, type, act) => element(id)?.addEventListener(type, act);
inputs.forEach((input, i) =>
  input.addEventListener("input", () => {
    settings.choose(i, Number(input.value));
    changed();
  }),
);
on("play", "click", () => play(started === null));
on("time", "input", () => {
  play(false);
  now = element("time").valueAsNumber;
  show();
});
on("drag", "click", () => {
  play(false);
  goal ? (goal = null) : drag();
  element("drag").setAttribute("aria-pressed", goal !== null);
  document.body.classList.toggle("dragged", goal !== null);
  if (!goal) changed();
});
on("reset", "click", () => {
  settings.reset();
  changed();
});
on("copy", "click", () => {
  element("yaml").hidden = false;
  getSelection().selectAllChildren(element("yaml"));
  navigator.clipboard?.writeText(settings.yaml).catch(() => {});
});
on("answer", "change", () => {
  const isRight = Math.abs(element("answer").valueAsNumber - data.lesson.value) <= data.lesson.within;
  element("verdict").textContent = isRight ? "Right." : "Not yet.";
});
addEventListener("hashchange", () => {
  settings.read(location.hash.slice(1));
  changed();
});
addEventListener("resize", show);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const { plot, place } of plots.values()) {
    plot.destroy();
    place.remove();
  }
  plots.clear();
  changed();
});
settings.read(location.hash.slice(1));
changed();
