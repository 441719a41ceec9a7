// The course of a world in WebAssembly: the whole path, or towards a goal that moves.

// Rows of columns that a moving goal keeps; numbers of a sample of the path; the longest delay [s].
const RING = 4096,
  SAMPLE = 13,
  LATEST = 0.2;

const floats = (text) => new Float32Array(bytesOf(text).buffer);

class Course {
  // `law` is the compiled module of law.wasm, and `data` what `rmrc.export.page` writes.
  constructor(law, data) {
    Object.assign(this, { law, data, n: data.joints.length });
  }

  // A world at its start, with some settings, and with room for rows of columns and at most as many samples.
  begun(old, settings, ticks, rows, samples) {
    const {
        data: { image, paths, period },
        n,
      } = this,
      past = Math.ceil(LATEST / period) + 4;
    const sizes = {
      columns: image.width * rows,
      reference: SAMPLE * rows,
      chance: (n + 2) * rows,
      past: past * (2 * n + 1),
      path: Math.max(...paths.map((path) => path.pieces.length)),
    };
    const arrays = { ...image.arrays };
    for (const [name, size] of Object.entries(sizes)) arrays[name] = [arrays[name][0], 8 * size, ""];
    const fits = old?.room >= rows && old.room < 4 * rows;
    const world = fits ? old : Object.assign(new World(this.law, { ...image, arrays }), { room: rows });
    world.begin();
    const counts = { ticks, rows, path_ticks: samples, width: image.width, past_rows: past };
    for (const [name, count] of Object.entries(counts)) world.setInteger(image.words[name], count);
    for (const { words, methods } of settings.effects) {
      for (const [bits, places] of Object.entries(words)) {
        for (const place of places)
          world.view.setBigUint64(world.record + 8 * place, BigInt(`0x${bits}`), true);
      }
      for (const [field, name] of Object.entries(methods)) world.setMethod(image.fields[field], name);
    }
    return world;
  }

  // The last rows of a world, as views of its memory.
  rows(world, rows) {
    const { image } = this.data,
      table = world.array("columns");
    const integers = new Int32Array(table.buffer, table.byteOffset, 2 * table.length);
    const count = Math.min(world.done, rows),
      first = world.done - count;
    const at = (name, k) => ((first + k) % rows) * image.width + image.columns[name][0];
    return {
      count,
      isDiverged: world.integer(image.words.diverged) >= 0,
      row: (name, k) => table.subarray(at(name, k), at(name, k) + (image.columns[name][1] || 1)),
      number: (name, k, i = 0) => table[at(name, k) + i],
      status: (k) => integers[2 * at("status", k)],
    };
  }

  // The whole path.
  run(settings) {
    const { path, ticks } = settings,
      pieces = new Float64Array(bytesOf(path.pieces).buffer);
    const world = (this.whole = this.begun(this.whole, settings, ticks, ticks, path.ticks));
    world.array("path").set(pieces);
    world.setInteger(this.data.image.words.path_size, pieces.length);
    world.samplePath();
    world.advance();
    return this.rows(world, ticks);
  }

  // A function that does some ticks towards a goal, from joint positions on, and returns the last rows.
  follower(settings, q) {
    const {
        image: { words },
        places,
      } = this.data,
      world = this.begun(null, settings, 2 ** 31, RING, RING);
    const positions = world.array("qpos"),
      chance = world.integer(words.chance);
    q.forEach((position, j) => {
      positions[places[j]] = position;
    });
    return (goal, ticks) => {
      const samples = world.array("reference");
      for (let k = 0; k < ticks + 2; k++) samples.set(goal, SAMPLE * k);
      world.setNumber(words.path_tick, 0);
      world.setInteger(words.chance, chance - 8 * (this.n + 2) * world.done);
      world.advance(ticks);
      return this.rows(world, RING);
    };
  }
}
