// The picture: shapes as the hulls of their points, back to front, seen without perspective.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const along = (p, v, part) => [p[0] + part * v[0], p[1] + part * v[1], p[2] + part * v[2]];
const GOLD = "#b08a00",
  GREEN = "#1e9650",
  INDIGO = "#5566ff",
  TEAL = "#00809c",
  RED = "#ff2d2d",
  LINK = "#7d858f";
// As in the recordings: the velocity ellipsoid is the way in this time at rates of norm 1 [s]; the force ellipsoid is
// as large where σ is half the reach, and no radius is longer than a part of the reach; so is the arrow.
const SECONDS = 0.2,
  LONGEST = 0.3,
  ARROW = 0.22;

// A vector turned by the quaternion of a pose, [p, w x y z].
function turned(pose, v) {
  const [w, x, y, z] = pose.slice(3);
  const t = [2 * (y * v[2] - z * v[1]), 2 * (z * v[0] - x * v[2]), 2 * (x * v[1] - y * v[0])];
  return [
    v[0] + w * t[0] + y * t[2] - z * t[1],
    v[1] + w * t[1] + z * t[0] - x * t[2],
    v[2] + w * t[2] + x * t[1] - y * t[0],
  ];
}

// Points, from little-endian 32-bit floats in base64.
function points(text) {
  const values = floats(text);
  return Array.from({ length: values.length / 3 }, (_, i) => [...values.subarray(3 * i, 3 * i + 3)]);
}

function mixed(color, other, part) {
  const channel = (text, i) => parseInt(text.slice(1 + 2 * i, 3 + 2 * i), 16);
  const mix = (i) => Math.round(channel(color, i) * (1 - part) + channel(other, i) * part);
  return `rgb(${[0, 1, 2].map(mix).join()})`;
}

// The corners of the convex hull of points in the plane.
function hull(all) {
  const sorted = [...all].sort((a, b) => a[0] - b[0] || a[1] - b[1]),
    corners = [];
  for (const side of [sorted, [...sorted].reverse()]) {
    const chain = [];
    const turnsRight = ([ax, ay], [bx, by], [x, y]) => (bx - ax) * (y - ay) - (by - ay) * (x - ax) <= 0;
    for (const p of side) {
      while (chain.length > 1 && turnsRight(...chain.slice(-2), p)) chain.pop();
      chain.push(p);
    }
    corners.push(...chain.slice(0, -1));
  }
  return corners;
}

const product = (a, b) => a.map((u) => b.map((v) => u.reduce((sum, value, j) => sum + value * v[j], 0))); // A Bᵀ
const summed = (a, b, part) => a.map((row, i) => row.map((value, j) => value + part * b[i][j]));
const identity = (n) =>
  Array.from({ length: n }, (_, i) => Array.from({ length: n }, (_, j) => Number(i === j)));

// The inverse of a positive matrix.
function inverse(matrix) {
  const n = matrix.length,
    unit = identity(n),
    rows = matrix.map((row, i) => [...row, ...unit[i]]);
  for (let i = 0; i < n; i++) {
    rows[i] = rows[i].map((value, _, row) => value / row[i]);
    for (let k = 0; k < n; k++) if (k !== i) rows[k] = summed([rows[k]], [rows[i]], -rows[k][i])[0];
  }
  return rows.map((row) => row.slice(n));
}

// M Mᵀ of the translations that the task has, while its rotations are held: M = J_v S_q (1 − J_w⁺ J_w). Its rows are
// along the axes of the task's frame, which come with it.
function mobility(J, { scale, rows }, frame) {
  const n = scale.length,
    axes = identity(3).map((axis) => (frame ? turned(frame, axis) : axis));
  const row = (r) =>
    scale.map(
      (factor, j) =>
        factor *
        dot(
          axes[r % 3],
          [0, 1, 2].map((i) => J[(r < 3 ? i : i + 3) * n + j]),
        ),
    );
  const moves = rows.filter((r) => r < 3),
    V = moves.map(row),
    W = rows.filter((r) => r > 2).map(row);
  const held = inverse(summed(product(W, W), identity(W.length), 1e-9)),
    VW = product(V, W);
  return {
    matrix: summed(product(V, V), product(product(VW, held), VW), -1),
    axes: moves.map((r) => axes[r]),
  };
}

class View {
  constructor(canvas, drawing) {
    const shapes = drawing.shapes.map((shape) => ({ ...shape, points: points(shape.points) }));
    Object.assign(this, {
      canvas,
      drawing,
      shapes,
      path: points(drawing.path),
      azimuth: -0.9,
      elevation: 0.45,
    });
  }

  // Axes of the screen: to the right, up, and towards the viewer.
  get axes() {
    if (this.drawing.screen) return this.drawing.screen;
    const [ca, sa, ce, se] = [this.azimuth, this.elevation].flatMap((angle) => [
      Math.cos(angle),
      Math.sin(angle),
    ]);
    return [
      [-sa, ca, 0],
      [-se * ca, -se * sa, ce],
      [ce * ca, ce * sa, se],
    ];
  }

  project(p) {
    const [x, y, depth] = this.axes.map((axis) => dot(axis, along(p, this.drawing.center, -1)));
    return [this.width / 2 + this.scale * x, this.height / 2 - this.scale * y, depth];
  }

  // The point at a place of the canvas, in the plane of the screen through another point.
  unproject(x, y, through) {
    const [right, up] = this.axes,
      [px, py] = this.project(through);
    return along(along(through, right, (x - px) / this.scale), up, (py - y) / this.scale);
  }

  outline(corners, fill, edge, width = 1) {
    const { pen } = this;
    pen.beginPath();
    for (const [x, y] of corners) pen.lineTo(x, y);
    pen.closePath();
    Object.assign(pen, { fillStyle: fill, strokeStyle: edge, lineWidth: width, lineJoin: "round" });
    pen.fill();
    pen.stroke();
  }

  line(all, color, width, dash = []) {
    const { pen } = this;
    pen.beginPath();
    for (const p of all) pen.lineTo(...this.project(p).slice(0, 2));
    Object.assign(pen, { strokeStyle: color, lineWidth: width, lineCap: "round", lineJoin: "round" });
    pen.setLineDash(dash);
    pen.stroke();
    pen.setLineDash([]);
  }

  ball(p, radius, fill, edge) {
    const [x, y] = this.project(p);
    const turn = Array.from({ length: 24 }, (_, i) => (i * Math.PI) / 12);
    this.outline(
      turn.map((angle) => [x + radius * Math.cos(angle), y + radius * Math.sin(angle)]),
      fill,
      edge,
      2,
    );
  }

  shape(corners, color) {
    const [xs, ys] = [0, 1].map((i) => corners.map((p) => p[i]));
    const ends = [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
    const light = this.pen.createLinearGradient(...ends);
    light.addColorStop(0, mixed(color, "#ffffff", 0.25));
    light.addColorStop(1, mixed(color, "#000000", 0.15));
    this.outline(corners, light, mixed(color, "#000000", 0.45));
  }

  // The outline of an ellipsoid: on the screen, a root of its matrix takes a circle there.
  ellipsoid(center, matrix, axes, color) {
    const seen = product(
      this.axes.slice(0, 2),
      axes.map((_, i) => axes[0].map((_, k) => axes[i][k])),
    );
    const [[xx, xy], [, yy]] = product(product(seen, matrix), seen),
      [x, y] = this.project(center);
    const a = Math.sqrt(Math.max(xx, 1e-9)),
      b = xy / a,
      c = Math.sqrt(Math.max(yy - b * b, 0));
    const circle = Array.from({ length: 60 }, (_, i) => [
      Math.cos((i * Math.PI) / 30),
      Math.sin((i * Math.PI) / 30),
    ]);
    const place = ([cos, sin]) => [x + this.scale * a * cos, y - this.scale * (b * cos + c * sin)];
    this.outline(circle.map(place), `${color}22`, color, 1.5);
  }

  // A double arrow.
  arrow(center, vector, color, width) {
    const [x, y] = this.project(center);
    for (const side of [1, -1]) {
      const end = along(center, vector, side),
        [ex, ey] = this.project(end),
        size = Math.hypot(ex - x, ey - y);
      if (size < 3) continue;
      const [dx, dy] = [(ex - x) / size, (ey - y) / size],
        head = Math.min(4 + 2 * width, size);
      this.line([center, end], color, width);
      const corner = (back, out) => [ex + dx * (2 - back) - dy * out, ey + dy * (2 - back) + dx * out];
      this.outline([corner(0, 0), corner(head, head / 2), corner(head, -head / 2)], color, color);
    }
  }

  floor(color) {
    const { foot, reach } = this.drawing,
      height = Math.min(0, foot[2]);
    const corner = (x, y) => [foot[0] + (x * reach) / 4, foot[1] + (y * reach) / 4, height];
    for (let i = -5; i <= 5; i++) {
      this.line([corner(i, -5), corner(i, 5)], color, 1);
      this.line([corner(-5, i), corner(5, i)], color, 1);
    }
  }

  // Draw `frames` behind the axes, `tip`, `target`, `J`, the `frame` of the task, a `trail` and how `near` each of its
  // points was to a singularity, the `lost` direction, the joints of a `ghost`, and the `marks` that are shown.
  draw(seen, ink) {
    const { canvas, drawing } = this,
      { reach, extent } = drawing,
      ratio = devicePixelRatio;
    [this.width, this.height] = [canvas.clientWidth, canvas.clientHeight];
    [canvas.width, canvas.height] = [Math.round(this.width * ratio), Math.round(this.height * ratio)];
    this.scale = Math.min(this.width / extent[0], this.height / extent[1]);
    this.pen = canvas.getContext("2d");
    this.pen.scale(ratio, ratio);
    if (!drawing.screen) this.floor(ink.line);
    const frames = drawing.axes.map((_, a) => seen.frames.slice(7 * a, 7 * a + 7));
    this.line(this.path, ink.ink, 1.5, [1, 4]);
    if (seen.ghost) this.line(seen.ghost, ink.ghost, Math.max(3, 0.03 * reach * this.scale));
    this.line([...frames, seen.tip], LINK, Math.max(3, 0.02 * reach * this.scale));
    const shapes = this.shapes.map(({ axis, color, points }) => {
      const place = (p) => (axis < 0 ? p : along(turned(frames[axis], p), frames[axis], 1));
      const all = points.map((p) => this.project(place(p)));
      return { color, all, depth: all.reduce((sum, p) => sum + p[2], 0) / all.length };
    });
    for (const { all, color } of shapes.sort((a, b) => a.depth - b.depth)) this.shape(hull(all), color);
    frames.forEach((frame, a) => {
      const way = turned(frame, drawing.axes[a]),
        ends = [-0.05, 0.05].map((part) => along(frame, way, part * reach));
      if (drawing.screen) this.ball(frame, 4, drawing.colors[a], ink.paper);
      else this.line(ends, drawing.colors[a], 4);
    });
    seen.trail
      .slice(1)
      .forEach((p, i) => this.line([seen.trail[i], p], mixed(GOLD, RED, seen.near[i + 1]), 2.5));
    this.drawMarks(seen);
    this.ball(
      seen.target,
      seen.isHeld ? 9 : 5,
      seen.isHeld ? `${RED}55` : "#0000",
      seen.isHeld ? RED : ink.ink,
    );
    this.ball(seen.tip, 3.5, GOLD, ink.ink);
  }

  drawMarks({ marks, tip, J, frame, lost, near }) {
    const { reach } = this.drawing,
      { matrix, axes } = mobility(J, this.drawing, frame);
    const unit = identity(axes.length),
      scaled = (some, factor) => some.map((row) => row.map((value) => factor * value));
    if (marks.has("velocity") && axes.length) this.ellipsoid(tip, scaled(matrix, SECONDS ** 2), axes, GREEN);
    if (marks.has("force") && axes.length) {
      const size = SECONDS * (0.5 * reach) ** 2,
        least = (size / (LONGEST * reach)) ** 2;
      this.ellipsoid(tip, scaled(inverse(summed(matrix, unit, least)), size ** 2), axes, GOLD);
    }
    for (const [first, color, width] of marks.has("lost")
      ? [
          [0, INDIGO, 3],
          [3, TEAL, 2],
        ]
      : []) {
      const part = [...lost.slice(first, first + 3)],
        way = frame ? turned(frame, part) : part;
      this.arrow(
        tip,
        way.map((value) => ARROW * reach * value),
        mixed(color, RED, near.at(-1)),
        width,
      );
    }
  }
}
