// A world in WebAssembly: the image that `rmrc.export.image` wrote, and its ticks.

const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

/** One world, with a memory of its own. */
export class World {
  /**
   * @param module The compiled module of law.wasm.
   * @param image The image of a world.
   */
  constructor(module, image) {
    this.image = image;
    this.exports = new WebAssembly.Instance(module).exports;
    this.slots = {};
    this.end = this.exports.__heap_base.value;
    this.start = bytesOf(image.record);
    this.record = this.place(this.start.length);
    this.arrays = {};
    for (const [name, [word, size, text]] of Object.entries(image.arrays)) {
      this.arrays[name] = { word, size, place: this.place(size), values: bytesOf(text) };
    }
    this.begin();
  }

  /** Reserve some bytes of memory; return where they are. */
  place(size) {
    const first = Math.ceil(this.end / 64) * 64;
    this.end = first + size;
    const { memory } = this.exports;
    const missing = this.end - memory.buffer.byteLength;
    if (missing > 0) memory.grow(Math.ceil(missing / 65536));
    this.view = new DataView(memory.buffer);
    return first;
  }

  /** Go back to the start. */
  begin() {
    const bytes = new Uint8Array(this.view.buffer);
    bytes.set(this.start, this.record);
    this.setInteger(this.image.words.record, this.record);
    for (const { word, size, place, values } of Object.values(this.arrays)) {
      bytes.fill(0, place, place + size);
      bytes.set(values, place);
      this.setInteger(word, place);
    }
    for (const [word, name] of this.image.methods) this.setMethod(word, name);
    this.samplePath();
  }

  /** Write the target at each tick, after a change of the array "path". */
  samplePath() {
    this.exports["reference.sample_reference"](this.record);
  }

  /** A whole number of the record, at an offset in bytes. */
  integer(word) {
    return Number(this.view.getBigInt64(this.record + word, true));
  }

  setInteger(word, value) {
    this.view.setBigInt64(this.record + word, BigInt(value), true);
  }

  setNumber(word, value) {
    this.view.setFloat64(this.record + word, value, true);
  }

  /** Have a word of the record name a method; "" is none. */
  setMethod(word, name) {
    if (name && !(name in this.slots)) {
      const table = this.exports.__indirect_function_table;
      this.slots[name] = table.grow(1);
      table.set(this.slots[name], this.exports[name]);
    }
    this.setInteger(word, name ? this.slots[name] : 0);
  }

  /** The numbers of an array, such as "reference", where the law reads them. */
  array(name) {
    const { place, size } = this.arrays[name];
    return new Float64Array(this.view.buffer, place, size / 8);
  }

  /** The number of finished ticks. */
  get done() {
    return this.integer(this.image.words.next);
  }

  /** Do some ticks at most; return whether there are more. */
  advance(count = Infinity) {
    const { ticks, last, diverged } = this.image.words;
    this.setInteger(last, Math.min(this.done + count, this.integer(ticks)));
    this.exports["ticks.ticks"](0, 0, 0, this.record);
    return this.integer(diverged) < 0 && this.done < this.integer(ticks);
  }
}
