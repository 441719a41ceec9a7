// A world in WebAssembly: the image that `rmrc.export.image` wrote, its ticks, and their columns.

const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
// Rows of columns that a moving goal keeps; numbers of a sample of the path.
const RING = 4096;
const SAMPLE = 13;

export class World {
  // `law` is the compiled module of law.wasm.
  constructor(law, image) {
    this.image = image;
    this.exports = new WebAssembly.Instance(law).exports;
    this.slots = {};
  }

  // Go to the start of a path, with differences from the image, and with room for rows of columns.
  begin(path, effects, ticks, rows) {
    const { arrays, methods, fields } = this.image;
    const { memory, __heap_base: heap } = this.exports;
    let end = heap.value;
    const placed = arrays.map(({ name, word, size, each, values }) => {
      const bytes = bytesOf(name === "path" ? path.pieces : values);
      const first = 64 * Math.ceil(end / 64);
      end = first + Math.max(bytes.length, size + each * rows);
      return { name, word, first, end, bytes };
    });
    const missing = end - memory.buffer.byteLength;
    if (missing > 0) memory.grow(Math.ceil(missing / 65536));
    this.view = new DataView(memory.buffer);
    this.places = Object.fromEntries(placed.map((place) => [place.name, place]));
    const all = new Uint8Array(memory.buffer).fill(0, heap.value);
    for (const { first, bytes } of placed) all.set(bytes, first);
    for (const { word, first } of placed) this.setInteger(word, first);
    for (const [word, name] of methods) this.setMethod(word, name);
    for (const { words, methods } of effects) {
      for (const [bits, places] of Object.entries(words)) {
        for (const place of places) this.setInteger(8 * place, `0x${bits}`);
      }
      for (const [field, name] of Object.entries(methods)) this.setMethod(fields[field], name);
    }
    const counts = { ticks, rows, path_ticks: path.ticks, path_size: this.array("path").length };
    for (const [name, count] of Object.entries(counts)) this.setInteger(this.image.words[name], count);
  }

  // A whole number of the record, at an offset in bytes.
  integer(word) {
    return Number(this.view.getBigInt64(this.places.record.first + word, true));
  }

  setInteger(word, value) {
    this.view.setBigUint64(this.places.record.first + word, BigInt(value), true);
  }

  // Have a word of the record name a method; "" is none.
  setMethod(word, name) {
    if (name && !(name in this.slots)) {
      const table = this.exports.__indirect_function_table;
      this.slots[name] = table.grow(1);
      table.set(this.slots[name], this.exports[name]);
    }
    this.setInteger(word, name ? this.slots[name] : 0);
  }

  // The numbers of an array, such as "reference", where the law reads them.
  array(name) {
    const { first, end } = this.places[name];
    return new Float64Array(this.view.buffer, first, (end - first) / 8);
  }

  // Do some ticks at most; return the columns of the last rows, as views of the memory.
  advance(count, rows) {
    const { image } = this;
    const { next, last, ticks, diverged } = image.words;
    this.setInteger(last, Math.min(this.integer(next) + count, this.integer(ticks)));
    this.exports["ticks.ticks"](0, 0, 0, this.places.record.first);
    const table = this.array("columns");
    const integers = new Int32Array(table.buffer, table.byteOffset, 2 * table.length);
    const first = Math.max(0, this.integer(next) - rows);
    const at = (name, k) => ((first + k) % rows) * image.width + image.columns[name][0];
    return {
      count: this.integer(next) - first,
      isDiverged: this.integer(diverged) >= 0,
      row: (name, k) => table.subarray(at(name, k), at(name, k) + (image.columns[name][1] || 1)),
      number: (name, k, i = 0) => table[at(name, k) + i],
      status: (k) => integers[2 * at("status", k)],
    };
  }

  // The whole path.
  run(path, effects, ticks) {
    this.begin(path, effects, ticks, ticks);
    this.exports["reference.sample_reference"](this.places.record.first);
    return this.advance(ticks, ticks);
  }

  // A function that does some ticks towards a goal, from joint positions on, and returns the last rows.
  follower(effects, q) {
    const { words, n, places } = this.image;
    this.begin({ ticks: RING, pieces: "" }, effects, 2 ** 31, RING);
    for (const [j, place] of places.entries()) this.array("qpos")[place] = q[j];
    const samples = this.array("reference");
    const chance = this.integer(words.chance);
    return (goal, count) => {
      for (let k = 0; k < count + 2; k++) samples.set(goal, SAMPLE * k);
      this.setInteger(words.path_tick, 0);
      this.setInteger(words.chance, chance - 8 * (n + 2) * this.integer(words.next));
      return this.advance(count, RING);
    };
  }
}
