"use strict";
// Plots over time that share cursor and zoom, from the JSON block "data"; and a button that copies text.
// `drawPanel` draws one in an element and returns it: its panel may have arrays, and change before `setData`.
(() => {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const paint = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const shown = (v) => v == null ? "–" : Math.abs(v) >= 1e6 || (v && Math.abs(v) < 1e-3) ?
    v.toExponential(2) : Math.abs(v) >= 1e3 ? Math.round(v).toLocaleString("en-US") : String(+v.toPrecision(4));

  // Values are little-endian 32-bit floats in base64; what is not finite is a gap.
  function values(text) {
    if (typeof text !== "string") return text;
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Array.from({length: bytes.length / 4}, (_, i) => view.getFloat32(4 * i, true))
      .map((v) => Number.isFinite(v) ? v : null);
  }

  const plots = [];
  let zooming = false;
  function zoomAll(from) {
    if (zooming) return;
    zooming = true;
    for (const plot of plots) if (plot !== from) plot.setScale("x", {min: from.scales.x.min, max: from.scales.x.max});
    zooming = false;
  }

  // Limits are dotted lines. A status has its name above its times, each a pixel wide at least.
  function marks(u, panel) {
    const {ctx, bbox} = u, ratio = uPlot.pxRatio;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineWidth = ratio;
    ctx.setLineDash([2 * ratio, 3 * ratio]);
    for (const level of panel.levels) {
      const y = u.valToPos(level.value, "y", true);
      ctx.strokeStyle = level.color;
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
    ctx.font = `${12 * ratio}px system-ui, sans-serif`;
    ctx.textAlign = "left";
    ctx.textBaseline = "middle";
    panel.lanes.forEach((lane, i) => {
      const top = bbox.top + i * 30 * ratio;
      for (const span of lane.spans) {
        const [begin, end] = span.map((time) => u.valToPos(time, "x", true));
        ctx.fillStyle = lane.color;
        ctx.fillRect(begin, top + 18 * ratio, Math.max(end - begin, ratio), 9 * ratio);
      }
      ctx.fillStyle = paint("--ink");
      ctx.fillText(lane.name, bbox.left + 4 * ratio, top + 9 * ratio);
    });
    ctx.restore();
  }

  // At most six powers of ten of an axis.
  function powers(u, i, low, high) {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
    const step = Math.ceil((last - first + 1) / 6), all = [];
    for (let n = first; n <= last; n += step) all.push(10 ** n);
    return all;
  }

  function draw(panel, place) {
    const lanes = panel.lanes.length, ink = paint("--ink"), line = paint("--line");
    const axis = {stroke: ink, grid: {stroke: line, width: 1}, ticks: {stroke: line}};
    const numbers = lanes ? {splits: () => []} : panel.logarithmic ?
      {splits: powers, filter: (u, all) => all, values: (u, all) => all.map((v) => v.toExponential(0))} :
      {values: (u, all) => all.map(shown)};
    const plot = new uPlot({
      width: place.clientWidth, height: panel.height ?? (lanes ? 72 + 30 * lanes : 250),
      legend: {show: !lanes},
      cursor: {sync: {key: "time", scales: ["x", null]}, drag: {x: true, y: false}},
      scales: {x: {time: false}, y: {distr: panel.logarithmic ? 3 : 1, range: () => panel.range}},
      axes: [{...axis, ...(panel.height ? {} : {label: "time [s]", labelSize: 20}), size: 30},
        {...axis, size: 62, ...(panel.height ? {space: 18} : {}), ...numbers}],
      series: [{label: "time [s]", value: (u, v) => shown(v)}, ...panel.curves.map((curve) => ({
        label: curve.label, stroke: curve.color, width: curve.width, dash: curve.dash, value: (u, v) => shown(v),
        points: {show: false},
      })), ...(lanes ? [{}] : [])],
      hooks: {
        draw: [(u) => marks(u, panel)],
        destroy: [(u) => { if (plots.includes(u)) plots.splice(plots.indexOf(u), 1); }],
        setScale: [(u, key) => { if (key === "x") zoomAll(u); }],
        setSeries: [(u, i, change) => {
          if (i && change.show != null) {
            u.root.querySelectorAll(".u-label")[i].setAttribute("aria-pressed", String(change.show));
          }
        }],
      },
    }, [values(panel.time), ...panel.curves.map((curve) => values(curve.values)),
      ...(lanes ? [values(panel.time).map(() => null)] : [])], place);
    const canvas = place.querySelector("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${panel.title} over time; its figures stand in the tables`);
    for (const [i, name] of place.querySelectorAll(".u-series .u-label").entries()) {
      if (!i) continue;  // the time is never hidden
      name.tabIndex = 0;
      name.setAttribute("role", "button");
      name.setAttribute("aria-pressed", "true");
      name.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        name.click();
      });
    }
    plots.push(plot);
    return plot;
  }
  globalThis.drawPanel = draw;

  function drawAll() {
    const block = document.getElementById("data");
    if (!block) return;
    for (const plot of plots.splice(0)) plot.destroy();
    JSON.parse(block.textContent).forEach((panel, i) => draw(panel, document.getElementById(`plot-${i}`)));
  }

  function copy(button) {
    const text = document.getElementById(button.dataset.copies);
    const select = () => {
      getSelection().selectAllChildren(text);
      button.textContent = "Selected: copy it with the keyboard";
    };
    if (!navigator.clipboard) return select();
    navigator.clipboard.writeText(text.textContent).then(() => { button.textContent = "Copied"; }, select);
  }

  drawAll();
  dark.addEventListener("change", drawAll);
  addEventListener("resize", () => {
    for (const plot of plots) plot.setSize({width: plot.root.parentElement.clientWidth, height: plot.height});
  });
  document.getElementById("whole")?.addEventListener("click", () => {
    for (const plot of plots) plot.setScale("x", {min: plot.data[0][0], max: plot.data[0].at(-1)});
  });
  for (const button of document.querySelectorAll("button[data-copies]")) button.addEventListener("click", () => copy(button));
})();
