// The picture: shapes as the hulls of their points, back to front, seen without perspective.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const along = (p, v, part) => [p[0] + part * v[0], p[1] + part * v[1], p[2] + part * v[2]];

// A vector turned by the quaternion of a pose, [p, w x y z]; and a point carried by it.
export function turned(pose, v) {
  const [w, x, y, z] = pose.slice(3);
  const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
  return [v[0] + w * t[0] + y * t[2] - z * t[1], v[1] + w * t[1] + z * t[0] - x * t[2],
    v[2] + w * t[2] + x * t[1] - y * t[0]];
}
const carried = (pose, v) => pose ? along(turned(pose, v), pose, 1) : v;

// A list of points, of little-endian 32-bit floats in base64.
export function points(text) {
  const values = floats(text);
  return Array.from({length: values.length / 3}, (_, i) => [...values.subarray(3 * i, 3 * i + 3)]);
}

function mixed(color, other, part) {
  const channel = (text, i) => parseInt(text.slice(1 + 2 * i, 3 + 2 * i), 16);
  return `rgb(${[0, 1, 2].map((i) => Math.round(channel(color, i) * (1 - part) + channel(other, i) * part)).join()})`;
}

// The corners of the convex hull of points in the plane.
function hull(all) {
  const sorted = [...all].sort((a, b) => a[0] - b[0] || a[1] - b[1]), ends = [];
  for (const side of [sorted, [...sorted].reverse()]) {
    const chain = [];
    for (const p of side) {
      for (let k = chain.length; k > 1; k = chain.length) {
        const [a, b] = chain.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    ends.push(...chain.slice(0, -1));
  }
  return ends;
}

// The inverse of a positive matrix.
function inverse(matrix) {
  const n = matrix.length, rows = matrix.map((row, i) => [...row, ...row.map((_, j) => Number(i === j))]);
  for (let i = 0; i < n; i++) {
    rows[i] = rows[i].map((value, _, row) => value / row[i]);
    for (let k = 0; k < n; k++) if (k !== i) rows[k] = rows[k].map((value, j) => value - rows[k][i] * rows[i][j]);
  }
  return rows.map((row) => row.slice(n));
}

// M Mᵀ, (3, 3) along world axes, of the translations that the task has, while its rotations are held:
// M = J_v S (1 − J_w⁺ J_w), with the rows along the axes of the task's frame.
function mobility(J, n, drawing, frame) {
  const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => frame ? turned(frame, axis) : axis);
  const row = (r) => Array.from({length: n}, (_, j) => drawing.scale[j] *
    [0, 1, 2].reduce((sum, i) => sum + axes[r % 3][i] * J[(i + (r > 2 ? 3 : 0)) * (J.length / 6) + j], 0));
  const product = (a, b) => a.map((u) => b.map((v) => u.reduce((sum, value, j) => sum + value * v[j], 0)));
  const moved = drawing.rows.filter((r) => r < 3), [V, W] = [moved, drawing.rows.filter((r) => r > 2)].map((some) => some.map(row));
  const VV = product(V, V), VW = product(V, W);
  const held = inverse(product(W, W).map((line, i) => line.map((value, j) => value + (i === j ? 1e-9 : 0))));
  const free = VV.map((line, i) => line.map((value, j) =>
    value - VW[i].reduce((sum, a, k) => sum + a * VW[j].reduce((inner, b, l) => inner + held[k][l] * b, 0), 0)));
  return {free, axes: moved.map((r) => axes[r])};
}

export class View {
  // `drawing` is what `rmrc.export.drawing` writes.
  constructor(canvas, drawing) {
    Object.assign(this, {canvas, drawing, shapes: drawing.shapes.map((shape) => ({...shape, points: points(shape.points)}))});
    this.path = points(drawing.path);
    this.azimuth = -0.9;
    this.elevation = 0.45;
    this.center = drawing.foot;
    this.fit([]);
  }

  get isFlat() { return this.drawing.flat >= 0; }

  // Axes of the screen: to the right, up, and towards the viewer.
  get axes() {
    if (this.isFlat) return [[[0, 1, 0], [0, 0, 1], [1, 0, 0]], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], [[1, 0, 0], [0, 1, 0], [0, 0, 1]]][this.drawing.flat];
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    return [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
  }

  // Have the picture show the path, the base and some more points.
  fit(more) {
    const all = [...this.path, ...more, this.drawing.foot];
    const [low, high] = [Math.min, Math.max].map((best) => [0, 1, 2].map((i) => all.reduce((value, p) => best(value, p[i]), all[0][i])));
    this.center = low.map((value, i) => (value + high[i]) / 2);
    const margin = 0.12 * this.drawing.reach, [right, up] = this.axes;
    this.extent = this.isFlat ? [right, up].map((axis) => all.reduce((most, p) => Math.max(most, Math.abs(dot(axis, along(p, this.center, -1)))), 0) + margin) :
      [0, 0].fill(all.reduce((most, p) => Math.max(most, Math.hypot(...along(p, this.center, -1))), 0) + margin);
  }

  project(p) {
    const [right, up, toward] = this.axes, d = along(p, this.center, -1);
    return [this.width / 2 + this.scale * dot(right, d), this.height / 2 - this.scale * dot(up, d), dot(toward, d)];
  }

  // The point at a place of the canvas, in the plane of the screen through another point.
  unproject(x, y, through) {
    const [right, up] = this.axes, [px, py] = this.project(through);
    return along(along(through, right, (x - px) / this.scale), up, (py - y) / this.scale);
  }

  line(all, color, width, dash = []) {
    const {pen} = this;
    pen.beginPath();
    all.map((p) => this.project(p)).forEach(([x, y], i) => i ? pen.lineTo(x, y) : pen.moveTo(x, y));
    Object.assign(pen, {strokeStyle: color, lineWidth: width, lineCap: "round", lineJoin: "round"});
    pen.setLineDash(dash);
    pen.stroke();
    pen.setLineDash([]);
  }

  ball(p, radius, fill, edge) {
    const [x, y] = this.project(p), {pen} = this;
    pen.beginPath();
    pen.arc(x, y, radius, 0, 7);
    Object.assign(pen, {fillStyle: fill, strokeStyle: edge, lineWidth: 2});
    pen.fill();
    pen.stroke();
  }

  // The outline of the ellipsoid of a matrix at a point: its square root takes a circle there.
  ellipsoid(center, matrix, axes, color) {
    const [right, up] = this.axes, {pen, scale} = this, [x, y] = this.project(center);
    const seen = (a, b) => matrix.reduce((sum, line, i) => sum + line.reduce((inner, value, j) => inner + value * dot(a, axes[i]) * dot(b, axes[j]), 0), 0);
    const a = Math.sqrt(Math.max(seen(right, right), 1e-12)), b = seen(right, up) / a, c = Math.sqrt(Math.max(seen(up, up) - b * b, 0));
    pen.beginPath();
    for (let i = 0; i <= 60; i++) {
      const [cos, sin] = [Math.cos(i * Math.PI / 30), Math.sin(i * Math.PI / 30)];
      pen.lineTo(x + scale * a * cos, y - scale * (b * cos + c * sin));
    }
    Object.assign(pen, {fillStyle: `${color}22`, strokeStyle: color, lineWidth: 1.5});
    pen.fill();
    pen.stroke();
  }

  // A double arrow.
  arrow(center, vector, color, width) {
    for (const side of [1, -1]) {
      const end = along(center, vector, side), [x, y] = this.project(end), [fx, fy] = this.project(center);
      const size = Math.hypot(x - fx, y - fy), {pen} = this;
      if (size < 3) continue;
      this.line([center, end], color, width);
      const [dx, dy] = [(x - fx) / size, (y - fy) / size], head = Math.min(4 + 2 * width, size);
      pen.beginPath();
      for (const [back, out] of [[0, 0], [head, head / 2], [head, -head / 2]]) pen.lineTo(x + dx * (2 - back) - dy * out, y + dy * (2 - back) + dx * out);
      pen.fillStyle = color;
      pen.fill();
    }
  }

  shape(all, color) {
    const corners = hull(all), {pen} = this, ys = corners.map((p) => p[1]), xs = corners.map((p) => p[0]);
    const light = pen.createLinearGradient(Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys));
    light.addColorStop(0, mixed(color, "#ffffff", 0.25));
    light.addColorStop(1, mixed(color, "#000000", 0.15));
    pen.beginPath();
    for (const [x, y] of corners) pen.lineTo(x, y);
    pen.closePath();
    Object.assign(pen, {fillStyle: light, strokeStyle: mixed(color, "#000000", 0.45), lineWidth: 1, lineJoin: "round"});
    pen.fill();
    pen.stroke();
  }

  floor(color) {
    const {foot} = this.drawing, step = this.drawing.reach / 4;
    for (let i = -5; i <= 5; i++) {
      for (const [a, b] of [[[i, -5], [i, 5]], [[-5, i], [5, i]]]) {
        this.line([a, b].map(([x, y]) => [foot[0] + x * step, foot[1] + y * step, Math.min(0, foot[2])]), color, 1);
      }
    }
  }

  // What is to be seen: `frames`, `tip`, `target`, `J`, `frame` of the task, `trail` and how near each of its points
  // was to a singularity, the direction `lost`, the joints of `ghost`, and the `marks` that are shown.
  draw(seen, ink) {
    const {canvas, drawing} = this, ratio = devicePixelRatio, {reach} = drawing;
    [this.width, this.height] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(this.width * ratio) || canvas.height !== Math.round(this.height * ratio)) {
      [canvas.width, canvas.height] = [Math.round(this.width * ratio), Math.round(this.height * ratio)];
    }
    const pen = this.pen = canvas.getContext("2d");
    this.scale = Math.min(this.width / this.extent[0], this.height / this.extent[1]) / 2;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, this.width, this.height);
    if (!this.isFlat) this.floor(ink.line);
    const poses = drawing.axes.map((_, a) => seen.frames.slice(7 * a, 7 * a + 7)), parts = [];
    const joints = [...poses, seen.tip];
    for (const shape of this.shapes) {
      const all = shape.points.map((p) => this.project(carried(shape.axis < 0 ? null : poses[shape.axis], p)));
      parts.push([all.reduce((sum, p) => sum + p[2], 0) / all.length, () => this.shape(all, shape.color)]);
    }
    joints.slice(1).forEach((end, a) => {
      const depth = (this.project(joints[a])[2] + this.project(end)[2]) / 2;
      parts.push([depth, () => this.line([joints[a], end], "#7d858f", Math.max(2, 0.018 * reach * this.scale))]);
    });
    this.line(this.path, ink.ink, 1.5, [1, 4]);
    if (seen.ghost) this.line(seen.ghost, ink.ghost, Math.max(3, 0.03 * reach * this.scale));
    for (const [, paint] of parts.sort((a, b) => a[0] - b[0])) paint();
    drawing.colors.forEach((color, a) => {
      const way = turned(poses[a], drawing.axes[a]), ends = [-0.05, 0.05].map((part) => along(joints[a], way, part * reach));
      if (this.isFlat) this.ball(joints[a], 4, color, ink.paper);
      else this.line(ends, color, 4);
    });
    seen.trail.slice(1).forEach((p, i) => this.line([seen.trail[i], p], mixed("#b08a00", "#ff2d2d", seen.near[i + 1]), 2.5));
    const {free, axes} = mobility(seen.J, drawing.scale.length, drawing, seen.frame), seconds = 0.2;
    if (seen.marks.has("velocity") && free.length) this.ellipsoid(seen.tip, free.map((line) => line.map((value) => seconds ** 2 * value)), axes, "#1e9650");
    if (seen.marks.has("force") && free.length) {
      const size = seconds * (0.5 * reach) ** 2, least = size / (0.3 * reach);  // equal where σ is half the reach; bounded
      const force = inverse(free.map((line, i) => line.map((value, j) => value + (i === j ? least ** 2 : 0))));
      this.ellipsoid(seen.tip, force.map((line) => line.map((value) => size ** 2 * value)), axes, "#b08a00");
    }
    if (seen.marks.has("lost")) {
      const near = seen.near.at(-1) ?? 0, parts_ = [0, 3].map((i) => seen.lost.slice(i, i + 3)).map((v) => seen.frame ? turned(seen.frame, v) : v);
      this.arrow(seen.tip, parts_[0].map((value) => 0.22 * reach * value), mixed("#5566ff", "#ff2d2d", near), 3);
      this.arrow(seen.tip, parts_[1].map((value) => 0.22 * reach * value), mixed("#00809c", "#ff2d2d", near), 2);
    }
    this.ball(seen.target, seen.isHeld ? 9 : 5, seen.isHeld ? "#ff2d2d55" : "#00000000", seen.isHeld ? "#ff2d2d" : ink.ink);
    this.ball(seen.tip, 3.5, "#b08a00", ink.ink);
  }
}
