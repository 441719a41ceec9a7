// The settings: what is chosen of each control, what that does to the law, and the scenario that has it.

const SPEED = "target.speed";

// A value on a line, as YAML reads it: numbers have a point before an exponent.
const inline = (value) =>
  JSON.stringify(value, null, 1)
    .replace(/\s*\n\s*/g, " ")
    .replace(/((?:^|[[,:] )-?\d+)e/g, "$1.0e");

// A mapping as YAML, each key on a line.
function yaml(mapping, indent = "") {
  const row = ([key, value]) =>
    value?.constructor === Object
      ? `${indent}${key}:\n${yaml(value, `${indent}  `)}`
      : `${indent}${key}: ${inline(value)}\n`;
  return Object.entries(mapping).map(row).join("");
}

class Settings {
  // `data` is what `rmrc.export.page` writes.
  constructor(data) {
    Object.assign(this, { data, controls: data.controls });
    this.read("");
  }

  // Choose what an address says after its #, and all else as the scenario has it.
  read(address) {
    const wanted = new URLSearchParams(address);
    this.chosen = this.controls.map((control) => control.start);
    this.controls.forEach((control, i) => {
      const number = control.values.findIndex((value) => String(value) === wanted.get(control.key));
      if (number >= 0) this.choose(i, number);
    });
  }

  // Choose the value with a number, unless it does not go with the others.
  choose(i, number) {
    const before = this.chosen[i];
    this.chosen[i] = number;
    if (!this.effects) this.chosen[i] = before;
  }

  // The differences from the image; undefined where values do not go together.
  get effects() {
    const all = this.data.groups.map(([members, table]) => table[members.map((i) => this.chosen[i]).join()]);
    return all.every(Boolean) ? all : undefined;
  }

  // The value of a key, or another one where it has no control.
  value(key, otherwise) {
    const i = this.controls.findIndex((control) => control.key === key);
    return i < 0 ? otherwise : this.controls[i].values[this.chosen[i]];
  }

  // The values that differ, by their keys.
  get changes() {
    const differ = this.controls.filter((control, i) => this.chosen[i] !== control.start);
    return Object.fromEntries(differ.map((control) => [control.key, this.value(control.key)]));
  }

  get path() {
    return this.data.paths.find((path) => path.speed === this.value(SPEED, 1));
  }

  // The largest number of ticks: more than the path has where a policy slows it.
  get ticks() {
    const slows = this.data.slow.includes(this.value("control.at_singularity", this.data.policy));
    return slows ? Math.ceil(this.data.longest * this.path.ticks) : this.path.ticks;
  }

  // Whether the law reads a key: one of its menus is read and has one of its names.
  isRead(key) {
    const control = this.controls.find((each) => each.key === key);
    const reads = ([menu, names]) => this.isRead(menu) && names.includes(this.value(menu));
    return !control || control.reads.length === 0 || control.reads.some(reads);
  }

  get yaml() {
    const scenario = structuredClone(this.data.scenario);
    const { [SPEED]: _, ...changes } = this.changes;
    for (const [key, value] of Object.entries({ ...changes, ...this.path.changes })) {
      const steps = key.split(".");
      const last = steps.pop();
      steps.reduce((node, step) => (node[step] ??= {}), scenario)[last] = value;
    }
    return yaml(scenario);
  }
}
