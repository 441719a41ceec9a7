"use strict";
// Plots over time that share cursor and zoom, from the JSON block "traces"; and buttons that copy text.
(() => {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const paint = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const shown = (v) => v == null ? "–" : Math.abs(v) >= 1e6 || (v && Math.abs(v) < 1e-3) ?
    v.toExponential(2) : Math.abs(v) >= 1e3 ? Math.round(v).toLocaleString("en-US") : String(+v.toPrecision(4));

  // Values are little-endian 32-bit floats in base64; what is not finite is a gap.
  function values(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const view = new DataView(bytes.buffer), out = new Array(bytes.length / 4);
    for (let i = 0; i < out.length; i++) {
      const v = view.getFloat32(4 * i, true);
      out[i] = Number.isFinite(v) ? v : null;
    }
    return out;
  }

  const plots = [];
  let zooming = false;
  function zoomAll(from) {
    if (zooming) return;
    zooming = true;
    for (const one of plots) if (one !== from) one.setScale("x", {min: from.scales.x.min, max: from.scales.x.max});
    zooming = false;
  }

  function lines(panel) {
    return (u) => {
      const {ctx} = u, ratio = uPlot.pxRatio;
      ctx.save();
      ctx.beginPath();
      ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
      ctx.clip();
      for (const line of panel.lines) {
        const y = u.valToPos(line.value, "y", true);
        ctx.strokeStyle = paint("--soft");
        ctx.lineWidth = ratio;
        ctx.setLineDash([2 * ratio, 3 * ratio]);
        ctx.beginPath();
        ctx.moveTo(u.bbox.left, y);
        ctx.lineTo(u.bbox.left + u.bbox.width, y);
        ctx.stroke();
      }
      ctx.restore();
    };
  }

  // All panels leave the same room on the left, so that times stand below each other.
  function room(panels) {
    const pen = document.createElement("canvas").getContext("2d");
    pen.font = "12px system-ui";
    return Math.max(75, ...panels.flatMap((one) => one.lanes).map((name) => pen.measureText(name).width + 20));
  }

  function pressed(u, i, change) {
    if (i && change.show != null) u.root.querySelectorAll(".u-label")[i].setAttribute("aria-pressed", String(change.show));
  }

  // At most six powers of ten of an axis; where it has fewer than three, their double and fivefold too.
  function powers(u, i, low, high) {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9);
    const step = Math.ceil((last - first + 1) / 6), found = [];
    const parts = last - first < 2 ? [1, 2, 5] : [1];
    for (let n = last - first < 2 ? first - 1 : first; n <= last; n += step || 1) {
      for (const one of parts) found.push(one * 10 ** n);
    }
    return found.filter((one) => one >= low * (1 - 1e-9) && one <= high * (1 + 1e-9));
  }

  function power(value) {
    return value < 1e-3 || value >= 1e4 ? value.toExponential(0) : String(Number(value.toPrecision(1)));
  }

  function draw(panel, place, first, left, isLast) {
    const axis = {stroke: paint("--ink"), grid: {stroke: paint("--line"), width: 1}, ticks: {stroke: paint("--line")}};
    const series = panel.series.map((one) => ({
      label: one.label, stroke: dark.matches ? one.dark : one.light, width: one.width, dash: one.dash, show: one.shown,
      spanGaps: one.spans, value: (u, v) => shown(v),
      points: {show: false},
    }));
    const y = {distr: panel.logarithmic ? 3 : 1};
    if (panel.range) y.range = () => panel.range;
    const plot = new uPlot({
      width: place.clientWidth, height: (panel.lanes.length ? 40 + 26 * panel.lanes.length : 200) + (isLast ? 22 : 0),
      legend: {show: !panel.lanes.length},
      cursor: {sync: {key: "time", scales: ["x", null]}, drag: {x: true, y: false}},
      scales: {x: {time: false}, y},
      axes: [{...axis, ...(isLast ? {label: "time [s]", labelSize: 22} : {}), size: 34},
        {...axis, ...(panel.unit ? {label: panel.unit, labelSize: 24, size: left - 24} : {size: left}),
        ...(panel.lanes.length ? {splits: () => panel.lanes.map((_, i) => i), values: () => panel.lanes} :
          panel.logarithmic ? {splits: powers, filter: (u, all) => all, values: (u, all) => all.map(power)} :
            {values: (u, all) => all.map(shown)})}],
      series: [{label: "time [s]", value: (u, v) => shown(v)}, ...series],
      hooks: {draw: [lines(panel)], setSeries: [pressed], setScale: [(u, key) => { if (key === "x") zoomAll(u); }]},
    }, [first, ...panel.series.map((one) => values(one.values))], place);
    const canvas = place.querySelector("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${panel.title} over time; its figures stand in the tables`);
    for (const [i, name] of place.querySelectorAll(".u-series .u-label").entries()) {
      if (!i) continue;  // the time is never hidden
      name.tabIndex = 0;
      name.setAttribute("role", "button");
      name.setAttribute("aria-pressed", String(plot.series[i].show));
      name.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        name.click();
      });
    }
    plots.push(plot);
  }

  function drawAll() {
    const block = document.getElementById("traces");
    if (!block) return;
    for (const one of plots.splice(0)) one.destroy();
    const panels = JSON.parse(block.textContent), left = room(panels);
    panels.forEach((panel, i) => {
      draw(panel, document.getElementById(panel.place), values(panel.time), left, i === panels.length - 1);
    });
  }

  function copy(button) {
    const text = document.getElementById(button.dataset.copies);
    const select = () => {
      const range = document.createRange();
      range.selectNodeContents(text);
      getSelection().removeAllRanges();
      getSelection().addRange(range);
      button.textContent = "Selected: copy it with the keyboard";
    };
    if (!navigator.clipboard) return select();
    navigator.clipboard.writeText(text.textContent).then(() => { button.textContent = "Copied"; }, select);
  }

  drawAll();
  dark.addEventListener("change", drawAll);
  addEventListener("resize", () => {
    for (const one of plots) one.setSize({width: one.root.parentElement.clientWidth, height: one.height});
  });
  document.getElementById("whole")?.addEventListener("click", () => {
    for (const one of plots) {
      const time = one.data[0];
      one.setScale("x", {min: time[0], max: time[time.length - 1]});
    }
  });
  for (const button of document.querySelectorAll("button[data-copies]")) button.addEventListener("click", () => copy(button));
})();
