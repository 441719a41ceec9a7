// The picture: shapes as the hulls of their points, back to front, seen without perspective.

const GRAY = "#949494";
const HUE = { gold: "#b08a00", green: "#1e9650", indigo: "#5566ff", teal: "#00809c", red: "#ff2d2d" };
// As in the recordings: the velocity ellipsoid is the way in this time at rates of norm 1 [s]; the force ellipsoid is
// as large where σ is half the reach, and no radius is longer than a part of the reach; so is the arrow.
const SECONDS = 0.2;
const LONGEST = 0.3;
const ARROW = 0.22;
// Directions in the plane, and in space.
const CIRCLE = [...Array(72).keys()].map((i) => [Math.cos((i * Math.PI) / 36), Math.sin((i * Math.PI) / 36)]);
const SPACE = [0, 1, 2].map((i) => [0, 1, 2].map((k) => Number(i === k)));

const dot = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);
const along = (p, v, part) => p.map((value, i) => value + part * v[i]);
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const mixed = (color, other, part) => `color-mix(in srgb, ${other} ${100 * part}%, ${color})`;
const floats = (text) => new Float32Array(bytesOf(text).buffer);

// Points, from floats in base64.
function points(text) {
  const values = floats(text);
  return Array.from({ length: values.length / 3 }, (_, i) => [...values.subarray(3 * i, 3 * i + 3)]);
}

// A vector turned by the quaternion of a pose, [p, w x y z].
function turned([, , , w, ...axis], v) {
  const way = cross(axis, v);
  return along(along(v, way, 2 * w), cross(axis, way), 2);
}

// The corners of the convex hull of points in the plane, up to some degrees: those that are farthest in a direction.
const hull = (all) =>
  CIRCLE.map((way) =>
    all.reduce((best, p) => (way[0] * (p[0] - best[0]) + way[1] * (p[1] - best[1]) > 0 ? p : best)),
  );

// Σ v vᵀ of some vectors; A + part · B; the inverse of a positive matrix. All are 3 by 3.
const squared = (all) =>
  [0, 1, 2].map((i) => [0, 1, 2].map((k) => all.reduce((sum, v) => sum + v[i] * v[k], 0)));
const summed = (a, b, part) => a.map((row, i) => along(row, b[i], part));
const inverse = ([a, b, c]) =>
  [cross(b, c), cross(c, a), cross(a, b)].map((v) => along([0, 0, 0], v, 1 / dot(a, cross(b, c))));

// How each joint moves the site along the axes of the task that are translations, while its rotations are held: by the
// rows of the Jacobian for these, without what they share with the rows for rotations.
function motions(J, { scale, rows }, axes) {
  const row = (r) => scale.map((factor, j) => factor * dot(axes[r % 3], J.slice(6 * j + (r < 3 ? 0 : 3))));
  const held = [];
  const freed = (r) => held.reduce((free, unit) => along(free, unit, -dot(free, unit)), row(r));
  for (const r of rows.filter((r) => r > 2)) {
    const free = freed(r);
    const size = Math.hypot(...free);
    if (size > 1e-6) held.push(free.map((value) => value / size));
  }
  const moves = rows.filter((r) => r < 3).map((r) => [axes[r], freed(r)]);
  return scale.map((_, j) => moves.reduce((sum, [axis, free]) => along(sum, axis, free[j]), [0, 0, 0]));
}

class View {
  constructor(canvas, drawing) {
    Object.assign(this, { canvas, drawing, azimuth: -0.9, elevation: 0.45, path: points(drawing.path) });
    this.shapes = drawing.shapes.map((shape) => ({ ...shape, points: points(shape.points) }));
  }

  // Axes of the screen: to the right, up, and towards the viewer.
  get axes() {
    if (this.drawing.screen) return this.drawing.screen;
    const [x, y, z] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.sin(this.elevation)];
    const flat = Math.cos(this.elevation);
    const back = [flat * x, flat * y, z];
    return [[-y, x, 0], cross(back, [-y, x, 0]), back];
  }

  project(p) {
    const [x, y, depth] = this.axes.map((axis) => dot(axis, along(p, this.drawing.center, -1)));
    return [this.width / 2 + this.scale * x, this.height / 2 - this.scale * y, depth];
  }

  // The point at a place of the canvas, in the plane of the screen through another point.
  unproject(x, y, through) {
    const [right, up] = this.axes;
    const [px, py] = this.project(through);
    return along(along(through, right, (x - px) / this.scale), up, (py - y) / this.scale);
  }

  // Draw a line through places of the canvas; with a fill it is closed.
  trace(places, color, width, { fill, dash = [] } = {}) {
    const { pen } = this;
    Object.assign(pen, { fillStyle: fill, strokeStyle: color, lineWidth: width });
    pen.setLineDash(dash);
    pen.beginPath();
    for (const [x, y] of places) pen.lineTo(x, y);
    if (fill) {
      pen.closePath();
      pen.fill();
    }
    pen.stroke();
  }

  line(all, color, width, dash) {
    const places = all.map((p) => this.project(p));
    this.trace(places, color, width, { dash });
  }

  ball(p, radius, fill, edge) {
    const [x, y] = this.project(p);
    const round = CIRCLE.map((way) => [x + radius * way[0], y + radius * way[1]]);
    this.trace(round, edge, 2, { fill });
  }

  shape(places, color) {
    const [xs, ys] = [0, 1].map((i) => places.map((p) => p[i]));
    const ends = [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
    const light = this.pen.createLinearGradient(...ends);
    light.addColorStop(0, mixed(color, "white", 0.25));
    light.addColorStop(1, mixed(color, "black", 0.15));
    this.trace(hull(places), mixed(color, "black", 0.45), 1, { fill: light });
  }

  // The outline of an ellipsoid: on the screen, a root of its matrix takes a circle there.
  ellipsoid(center, matrix, size, color) {
    const [x, y] = this.project(center);
    const [right, up] = this.axes;
    const [across, upwards] = [right, up].map((axis) => matrix.map((row) => dot(row, axis)));
    const a = Math.sqrt(Math.max(dot(right, across), 1e-9));
    const b = dot(up, across) / a;
    const c = Math.sqrt(Math.max(dot(up, upwards) - b * b, 0));
    const reach = this.scale * size;
    const round = CIRCLE.map(([cos, sin]) => [x + reach * a * cos, y - reach * (b * cos + c * sin)]);
    this.trace(round, color, 1.5, { fill: `${color}22` });
  }

  // A double arrow.
  arrow(center, vector, color, width) {
    const [x, y] = this.project(center);
    for (const side of [1, -1]) {
      const end = along(center, vector, side);
      const [ex, ey] = this.project(end);
      if (Math.hypot(ex - x, ey - y) < 3) continue;
      const angle = Math.atan2(ey - y, ex - x);
      const barb = (turn) => [ex - 8 * Math.cos(angle + turn), ey - 8 * Math.sin(angle + turn)];
      this.line([center, end], color, width);
      this.trace([barb(0.45), [ex, ey], barb(-0.45)], color, 2, { fill: color });
    }
  }

  floor(color) {
    const { foot, reach } = this.drawing;
    const corner = (x, y) => [foot[0] + (x * reach) / 4, foot[1] + (y * reach) / 4, Math.min(0, foot[2])];
    for (let i = -5; i <= 5; i++) {
      this.line([corner(i, -5), corner(i, 5)], color, 1);
      this.line([corner(-5, i), corner(5, i)], color, 1);
    }
  }

  // Draw a tick of a run, with the `trail` of some ticks, how `near` a tick is to a singularity, the joints of a
  // `ghost`, and the `marks` that are shown.
  draw(run, k, { trail, near, ghost, marks }, ink) {
    const { canvas, drawing } = this;
    const { reach, extent, axes, screen, colors } = drawing;
    [this.width, this.height] = [canvas.clientWidth, canvas.clientHeight];
    [canvas.width, canvas.height] = [this.width * devicePixelRatio, this.height * devicePixelRatio];
    this.scale = Math.min(this.width / extent[0], this.height / extent[1]);
    this.pen = canvas.getContext("2d");
    this.pen.scale(devicePixelRatio, devicePixelRatio);
    Object.assign(this.pen, { lineJoin: "round", lineCap: "round" });
    if (!screen) this.floor(ink.line);
    const tip = run.row("pose", k);
    const frames = axes.map((_, a) => run.row("frame", k).slice(7 * a, 7 * a + 7));
    this.line(this.path, ink.ink, 1.5, [1, 4]);
    this.line(ghost, ink.ghost, Math.max(3, 0.03 * reach * this.scale));
    this.line([...frames, tip], "#7d858f", Math.max(3, 0.02 * reach * this.scale));
    const shapes = this.shapes.map(({ axis, color, points }) => {
      const place = (p) => (axis < 0 ? p : along(frames[axis], turned(frames[axis], p), 1));
      const places = points.map((p) => this.project(place(p)));
      return { color, places, depth: places.reduce((sum, p) => sum + p[2], 0) / places.length };
    });
    for (const { places, color } of shapes.sort((a, b) => a.depth - b.depth)) this.shape(places, color);
    frames.forEach((frame, a) => {
      const ends = [-0.05, 0.05].map((part) => along(frame, turned(frame, axes[a]), part * reach));
      if (screen) this.ball(frame, 4, colors[a], ink.paper);
      else this.line(ends, colors[a], 4);
    });
    const color = (hue, i) => mixed(hue, HUE.red, near(i));
    for (const [n, i] of trail.entries()) {
      this.line([run.row("pose", trail[Math.max(0, n - 1)]), run.row("pose", i)], color(HUE.gold, i), 2.5);
    }
    const pose = { world: [0, 0, 0, 1, 0, 0, 0], base: drawing.base, site: tip }[drawing.frame];
    this.drawEllipsoids(tip, run.row("J", k), pose, marks);
    if (marks.has("lost")) {
      const way = (first) =>
        turned(pose, run.row("u_min", k).slice(first)).map((part) => ARROW * reach * part);
      this.arrow(tip, way(0), color(HUE.indigo, k), 3);
      this.arrow(tip, way(3), color(HUE.teal, k), 2);
    }
    this.ball(run.row("pose_ref", k), 6, "#0000", ink.goal);
    this.ball(tip, 3.5, HUE.gold, ink.ink);
  }

  drawEllipsoids(tip, J, pose, marks) {
    const { reach, rows } = this.drawing;
    const axes = SPACE.map((axis) => turned(pose, axis));
    const matrix = squared(motions(J, this.drawing, axes));
    if (marks.has("velocity")) this.ellipsoid(tip, matrix, SECONDS, HUE.green);
    if (!marks.has("force")) return;
    const size = SECONDS * (0.5 * reach) ** 2;
    const moves = squared(rows.filter((r) => r < 3).map((r) => axes[r]));
    const others = summed(SPACE, moves, -1);
    const bounded = summed(summed(matrix, moves, (size / (LONGEST * reach)) ** 2), others, 1);
    this.ellipsoid(tip, summed(inverse(bounded), others, -1), size, HUE.gold);
  }
}
