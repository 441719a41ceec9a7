// The page: settings, the run of the law, curves, figures, time, and the goal that follows the pointer.

const element = (id) => document.getElementById(id);
async function unpacked(id) {
  const bytes = Uint8Array.from(atob(element(id).textContent), (c) => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate")));
}
const data = await (await unpacked("scenario")).json();
const course = new Course(await WebAssembly.compile(await (await unpacked("law")).arrayBuffer()), data);
const settings = new Settings(data), {controls} = settings;
const STEP = 0.02, PLOTTED = 4000;
const SECTIONS = {
  "control.inverse": "Inverse", "control.feedback": "Inverse", "control.nullspace": "Null space",
  "control.limits": "Limits", plant: "Plant", target: "Path",
};
const SYMBOLS = {"control.inverse.damping.maximum": "λ", "control.inverse.damping.below": "ε", "control.feedback": "K"};
const shown = (value) => value == null ? "none" : Array.isArray(value) ? value.map(shown).join(", ") :
  typeof value === "number" ? String(+value.toPrecision(4)) : value;

// Settings ---------------------------------------------------------------------------------------

function makeControls() {
  const sections = new Map();
  controls.forEach((control, i) => {
    const title = SECTIONS[Object.keys(SECTIONS).find((start) => control.key.startsWith(start))] ?? "Near a singularity";
    if (!sections.has(title)) {
      const box = document.createElement("fieldset");
      box.append(Object.assign(document.createElement("legend"), {textContent: title}));
      sections.set(title, element("controls").appendChild(box));
    }
    const isMenu = typeof control.values[control.start] === "string", row = document.createElement("div");
    const input = document.createElement(isMenu ? "select" : "input");
    const label = Object.assign(document.createElement("label"), {
      htmlFor: input.id = `control-${i}`, title: control.meaning,
      textContent: `${control.key.replace(/^control\.((inverse|nullspace|limits)\.)?/, "")} ${SYMBOLS[control.key] ?? ""}`,
    });
    row.className = "control";
    row.append(label, document.createElement("output"), input);
    if (isMenu) for (const name of control.values) input.add(new Option(name, name));
    else Object.assign(input, {type: "range", min: 0, max: control.values.length - 1, step: 1});
    input.addEventListener("input", () => {
      settings.choose(i, isMenu ? input.selectedIndex : Number(input.value));
      changed();
    });
    Object.assign(control, {row, input, isMenu});
    sections.get(title).append(row);
  });
}

function showControls() {
  controls.forEach((control, i) => {
    const value = control.values[settings.chosen[i]], text = `${shown(value)}${control.unit === "1" || value == null ? "" : ` ${control.unit}`}`;
    control.row.hidden = !settings.isRead(control);
    control.row.classList.toggle("changed", settings.chosen[i] !== control.start);
    if (control.isMenu) control.input.selectedIndex = settings.chosen[i];
    else {
      control.input.value = settings.chosen[i];
      control.input.setAttribute("aria-valuetext", text);
      control.row.querySelector("output").textContent = text;
    }
  });
  element("reset").disabled = settings.isWritten;
}

// The run ----------------------------------------------------------------------------------------

const dark = matchMedia("(prefers-color-scheme: dark)");
const paint = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const n = data.joints.length, units = [...new Set(data.joints.map((joint) => joint.unit))].join(", ");
const view = new View(element("arm"), data.drawing);
const moved = data.drawing.rows.filter((row) => row < 3), turns = data.drawing.rows.filter((row) => row > 2);
let run, now = 0, dragged = null;
const row = (name, k) => run.row(name, k);
const size = (name, k, items) => Math.hypot(...items.map((i) => row(name, k)[i]));
const fastest = (name, k) => row(name, k).reduce((most, rate) => Math.max(most, Math.abs(rate)), 0);
const least = (k) => row("sigma", k).at(-1);
const timeAt = (k) => run.number("time", k);
const clipped = (value, low, high) => Math.min(Math.max(value, low), high);

// The ticks that are plotted: of many, those with the extremes of each span.
function ticksToPlot() {
  const all = Array.from({length: run.count}, (_, k) => k), span = Math.ceil(2 * run.count / PLOTTED);
  if (run.count <= PLOTTED) return all;
  const rows = new Set([0, run.count - 1]);
  for (let k = 0; k < run.count; k += span) {
    const some = all.slice(k, k + span), best = (value) => some.reduce((a, b) => value(b) > value(a) ? b : a);
    rows.add(best((i) => fastest("qdot_cmd", i))).add(best((i) => -least(i)));
  }
  return [...rows].sort((a, b) => a - b);
}

// Values of the run that MuJoCo made, at some times: each holds until the next.
function beside(name, times) {
  if (!data.written || dragged) return null;
  const time = floats(data.written.time), values = floats(data.written[name]);
  let k = 0;
  return times.map((t) => {
    while (k + 1 < time.length && time[k + 1] <= t + 1e-9) k++;
    return t > time.at(-1) + 1e-9 ? null : values[k];
  });
}

function makePanels() {
  const ticks = ticksToPlot(), time = ticks.map((k) => timeAt(k)), curve = (value) => ticks.map(value);
  const gray = settings.isWritten ? paint("--ink") : "#949494", label = settings.isWritten ? "MuJoCo" : "MuJoCo, as written";
  const panels = [], names = {rates: `, ${data.written?.joint}`};
  const add = (id, title, curves, name, more) => {
    const extra = beside(name, time);
    if (extra) curves.push({label: label + (names[name] ?? ""), color: gray, width: 1, dash: [6, 3], values: extra});
    const values = curves.flatMap((each) => each.isBeside ? [] : each.values).filter((value) => Number.isFinite(value));
    panels.push({id, title, time, curves, levels: [], lanes: [], logarithmic: false, height: 150, ...more(values)});
  };
  const peaks = data.joints.map((_, j) => ticks.reduce((most, k) => Math.max(most, Math.abs(row("qdot_plain", k)[j]) || 0), 0));
  const plain = peaks.indexOf(Math.max(...peaks));
  add("rates", `Rates commanded [${units}/s]`, [
    ...data.joints.map((joint, j) => ({label: joint.name, color: joint.color, width: 1.5, values: curve((k) => row("qdot_cmd", k)[j])})),
    {label: `plain inverse, ${data.joints[plain].name}`, color: "#808890", width: 1, dash: [2, 2], isBeside: true, values: curve((k) => row("qdot_plain", k)[plain])},
  ], "rates", (values) => {
    const most = 1.25 * Math.max(1e-3, ...values.map(Math.abs));
    return {range: [-most, most], levels: [...new Set(row("limit", 0))].flatMap((limit) => [limit, -limit]).map((value) => ({value, color: "#949494"}))};
  });
  const damping = curve((k) => run.number("damping", k) || null);
  add("sigma", "σ_min and λ", [
    {label: "σ_min", color: "#1e9650", width: 1.5, values: curve((k) => Math.max(least(k), 1e-6))},
    {label: "λ", color: "#b4289b", width: 1.5, dash: [5, 2], values: damping},
  ], "sigma", (values) => ({
    logarithmic: true, levels: [{value: settings.value("control.inverse.damping.below", data.below), color: "#949494"}],
    range: [10 ** Math.floor(Math.log10(Math.min(...values))), 10 ** Math.ceil(Math.log10(Math.max(...values)) + 1e-9)],
  }));
  for (const [id, title, items, color] of [["error", "Position error [mm]", moved, "#b08a00"], ["turn", "Rotation error [mrad]", turns, "#00809c"]]) {
    if (!items.length) continue;
    const own = [{label: "error", color, width: 1.5, values: curve((k) => 1e3 * size("pose_error", k, items))}];
    add(id, title, own, id, (values) => ({range: [0, 1.1 * Math.max(1e-3, ...values)]}));
  }
  const lanes = data.statuses.map((status) => ({...status, spans: spans(status.bit)})).filter((lane) => lane.spans.length);
  if (lanes.length) panels.push({id: "status", title: "Status", time, curves: [], levels: [], lanes, range: [0, 1], logarithmic: false});
  return panels;
}

// Begin and end of each time with a status.
function spans(bit) {
  const found = [];
  for (let k = 0; k < run.count; k++) {
    if (!(run.status(k) & bit)) continue;
    if (found.length && found.at(-1)[1] >= timeAt(k) - 1e-9) found.at(-1)[1] = timeAt(k) + data.period;
    else found.push([timeAt(k), timeAt(k) + data.period]);
  }
  return found;
}

const plots = new Map();
function showPanels() {
  const panels = makePanels();
  for (const [id, {place, plot}] of plots) {
    if (panels.some((panel) => panel.id === id) && id !== "status") continue;
    plot.destroy();
    place.remove();
    plots.delete(id);
  }
  for (const panel of panels) {
    const old = plots.get(panel.id);
    if (old && old.panel.curves.map((curve) => curve.label).join() === panel.curves.map((curve) => curve.label).join()) {
      Object.assign(old.panel, panel);
      old.plot.setData([panel.time, ...panel.curves.map((curve) => curve.values)]);
      continue;
    }
    old?.plot.destroy();
    const place = old?.place ?? element("plots").appendChild(document.createElement("div"));
    if (!old) place.append(Object.assign(document.createElement("h2"), {textContent: panel.title}));
    const line = Object.assign(document.createElement("div"), {className: "now"}), plot = drawPanel(panel, place);
    plot.over.append(line);
    plots.set(panel.id, {panel, place, plot, line});
  }
}

function figures() {
  const most = (value) => Array.from({length: run.count}, (_, k) => k).reduce((a, k) => Math.max(a, value(k) || 0), 0);
  const last = run.count - 1, table = {
    "joint_rate_cmd.peak": [most((k) => fastest("qdot_cmd", k)), `${units}/s`],
    "sigma.min": [1 / most((k) => 1 / least(k)), ""], "damping.max": [most((k) => run.number("damping", k)), ""],
    duration: [timeAt(last), "s"],
  };
  for (const [name, items, unit] of [["position_error", moved, "mm"], ["orientation_error", turns, "mrad"]]) {
    if (!items.length) continue;
    table[`${name}.max`] = [1e3 * most((k) => size("pose_error", k, items)), unit];
    table[`${name}.end`] = [1e3 * size("pose_error", last, items), unit];
  }
  return table;
}

function showFigures() {
  const table = figures();
  element("table").innerHTML = Object.entries(table).map(([name, [value, unit]]) =>
    `<tr><th scope="row">${name}</th><td>${shown(value)}</td><td class="word">${unit}</td></tr>`).join("");
  const [rate, unit] = table["joint_rate_cmd.peak"], error = table["position_error.max"] ?? table["orientation_error.max"];
  element("summary").textContent = `Largest rate ${shown(rate)} ${unit}, largest error ${shown(error[0])} ${error[1]}.`;
}

// The picture ------------------------------------------------------------------------------------

const marks = new Set(data.lesson?.shows ?? ["velocity", "lost"]);
const skeleton = data.written && {time: floats(data.written.skeleton.time), points: points(data.written.skeleton.points)};

function ghost(time) {
  if (!skeleton || dragged || time > skeleton.time.at(-1) + 0.1) return null;
  const count = skeleton.points.length / skeleton.time.length, last = skeleton.time.length - 1;
  const i = clipped(Math.round(time / skeleton.time[last] * last), 0, last);
  return skeleton.points.slice(i * count, (i + 1) * count);
}

function show() {
  const k = dragged ? run.count - 1 : clipped(Math.round(now / data.period), 0, run.count - 1), time = timeAt(k);
  const from = Math.max(0, k - Math.round((dragged ? 3 : 1e9) / data.period)), step = Math.max(1, Math.ceil((k - from) / 300));
  const trail = Array.from({length: Math.floor((k - from) / step) + 1}, (_, i) => k - i * step).reverse();
  const frame = {world: null, base: data.drawing.base, site: row("pose", k)}[data.drawing.frame];
  const ink = Object.fromEntries(["ink", "line", "paper"].map((name) => [name, paint(`--${name}`)]));
  view.draw({
    frames: row("frame", k), tip: row("pose", k), target: row("pose_ref", k), J: row("J", k), lost: row("u_min", k), frame, marks,
    trail: trail.map((i) => row("pose", i)), near: trail.map((i) => 1 - clipped(least(i) / data.below, 0, 1)),
    ghost: ghost(time), isHeld: Boolean(dragged),
  }, {...ink, ghost: settings.isWritten ? "#2f7fe866" : "#94949466"});
  element("time").value = time;
  element("clock").textContent = `${time.toFixed(2)} s`;
  for (const {plot, line} of plots.values()) line.style.left = `${plot.valToPos(time, "x")}px`;
}

// Time -------------------------------------------------------------------------------------------

let playing = null;
function play(starts) {
  playing = starts ? performance.now() - 1e3 * (now >= timeAt(run.count - 1) ? 0 : now) : null;
  element("play").textContent = starts ? "Pause" : "Play";
  if (starts) requestAnimationFrame(advance);
}

function advance(clock) {
  if (playing == null) return;
  now = Math.min((clock - playing) / 1e3, timeAt(run.count - 1));
  show();
  if (now < timeAt(run.count - 1)) requestAnimationFrame(advance);
  else play(false);
}

// The goal that follows pointer and keys, in real time --------------------------------------------

function drag(starts) {
  play(false);
  element("drag").setAttribute("aria-pressed", String(starts));
  element("help").textContent = starts ? "Move the pointer, or use the arrow keys and Page Up and Down: the law follows the goal, at any place." :
    view.isFlat ? "" : "Turn the picture with the pointer or the arrow keys.";
  if (starts) {
    const k = clipped(Math.round(now / data.period), 0, run.count - 1);
    dragged = {goal: [...row("pose", k)], follow: course.follower(settings, row("q", k)), clock: performance.now(), frames: 0};
    requestAnimationFrame(follow);
  } else if (dragged) {
    dragged = null;
    changed();
  }
}

function follow(clock) {
  if (!dragged) return;
  const ticks = clipped(Math.round((clock - dragged.clock) / 1e3 / data.period), 0, Math.ceil(0.05 / data.period));
  dragged.clock = clock;
  if (ticks) run = dragged.follow(dragged.goal, ticks);
  if (run.count && dragged.frames++ % 6 === 0) {
    showPanels();
    showFigures();
  }
  if (run.count) show();
  requestAnimationFrame(follow);
}

let held = null;
view.canvas.addEventListener("pointerdown", (event) => {
  held = [event.offsetX, event.offsetY];
  view.canvas.setPointerCapture(event.pointerId);
});
view.canvas.addEventListener("pointerup", () => { held = null; });
view.canvas.addEventListener("pointermove", (event) => {
  if (dragged && (held || view.isFlat)) dragged.goal.splice(0, 3, ...view.unproject(event.offsetX, event.offsetY, dragged.goal));
  else if (held && !view.isFlat) turn((held[0] - event.offsetX) / 150, (event.offsetY - held[1]) / 150);
  if (held) held = [event.offsetX, event.offsetY];
});

function turn(sideways, upwards) {
  view.azimuth += sideways;
  view.elevation = clipped(view.elevation + upwards, -1.5, 1.5);
  if (!dragged) show();
}

view.canvas.addEventListener("keydown", (event) => {
  const ways = {ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowDown: [0, -1, 0], ArrowUp: [0, 1, 0], PageDown: [0, 0, -1], PageUp: [0, 0, 1]};
  const way = ways[event.key];
  if (!way) return;
  event.preventDefault();
  if (!dragged) return turn(-0.1 * way[0], 0.1 * way[1]);
  for (const [i, axis] of view.axes.entries()) dragged.goal.splice(0, 3, ...along(dragged.goal.slice(0, 3), axis, STEP * data.drawing.reach * way[i]));
});

// A lesson ---------------------------------------------------------------------------------------

function showLesson({title, about, questions, number, value}) {
  const box = element("lesson"), add = (tag, text, parent = box) => parent.appendChild(Object.assign(document.createElement(tag), {textContent: text}));
  box.hidden = false;
  add("h2", title);
  add("p", about);
  for (const {ask, do: what} of questions) {
    const part = add("details", "");
    add("summary", ask, part);
    add("p", what, part);
  }
  const label = add("label", `${number.ask} [${number.unit}] `), answer = add("input", "", label), verdict = add("output", "");
  answer.type = "number";
  answer.step = "any";
  answer.addEventListener("change", () => {
    verdict.textContent = Math.abs(answer.valueAsNumber - value) <= number.within ? " Right." : " Not yet.";
  });
}

// All together -----------------------------------------------------------------------------------

let isDue = false;
function changed() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    showControls();
    history.replaceState(null, "", `#${new URLSearchParams(settings.changes)}`);
    element("yaml").textContent = settings.yaml;
    if (dragged) return drag(true);
    const started = performance.now();
    run = course.run(settings);
    element("time").max = timeAt(run.count - 1);
    showPanels();
    showFigures();
    show();
    document.body.dataset.redrawn = String(Math.round(performance.now() - started));
  });
}

makeControls();
settings.read(location.hash.slice(1));
for (const mark of ["velocity", "force", "lost"]) {
  const label = document.createElement("label"), box = Object.assign(document.createElement("input"), {type: "checkbox", checked: marks.has(mark)});
  box.addEventListener("change", () => {
    marks[box.checked ? "add" : "delete"](mark);
    show();
  });
  label.append(box, ` ${{velocity: "velocity ellipsoid", force: "force ellipsoid", lost: "lost direction"}[mark]} `);
  element("marks").append(label);
}
if (data.lesson) showLesson(data.lesson);
element("play").addEventListener("click", () => play(playing == null));
element("drag").addEventListener("click", () => drag(!dragged));
element("time").addEventListener("input", () => {
  play(false);
  now = Number(element("time").value);
  show();
});
element("reset").addEventListener("click", () => {
  settings.reset();
  changed();
});
element("copy").addEventListener("click", () => {
  element("yaml").hidden = false;
  navigator.clipboard?.writeText(element("yaml").textContent).catch(() => {});
  getSelection().selectAllChildren(element("yaml"));
});
addEventListener("hashchange", () => {
  settings.read(location.hash.slice(1));
  changed();
});
addEventListener("resize", () => show());
dark.addEventListener("change", () => {
  for (const {plot, place} of plots.values()) {
    plot.destroy();
    place.remove();
  }
  plots.clear();
  changed();
});
element("arm").setAttribute("aria-label", `The arm of ${data.name}, its path, and where its tip was`);
changed();
