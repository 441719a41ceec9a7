// The settings: what is chosen of each control, what that does to the law, and the scenario that has it.

const SPEED = "target.speed";

// Numbers as YAML reads them: with a point before an exponent.
function inline(value) {
  if (Array.isArray(value)) return `[${value.map(inline).join(", ")}]`;
  if (value && typeof value === "object") {
    return `{${Object.entries(value)
      .map(([key, inner]) => `${key}: ${inline(inner)}`)
      .join(", ")}}`;
  }
  return typeof value === "number"
    ? JSON.stringify(value).replace(/^(-?\d+)e/, "$1.0e")
    : JSON.stringify(value);
}

const isMapping = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

// A mapping as YAML, the innermost values on one line.
function yaml(mapping, indent = "") {
  return Object.entries(mapping)
    .map(([key, value]) => {
      const isDeep = isMapping(value) && Object.values(value).some((inner) => typeof inner === "object");
      return isDeep
        ? `${indent}${key}:\n${yaml(value, `${indent}  `)}`
        : `${indent}${key}: ${inline(value)}\n`;
    })
    .join("");
}

class Settings {
  // `data` is what `rmrc.export.page` writes.
  constructor(data) {
    Object.assign(this, { data, controls: data.controls });
    this.reset();
  }

  reset() {
    this.chosen = this.controls.map((control) => control.start);
  }

  get isWritten() {
    return this.chosen.every((number, i) => number === this.controls[i].start);
  }

  // The value of a key, or another one where it has no control.
  value(key, otherwise) {
    const i = this.controls.findIndex((control) => control.key === key);
    return i < 0 ? otherwise : this.controls[i].values[this.chosen[i]];
  }

  // The differences from the image; undefined where values do not go together.
  get effects() {
    const all = this.data.groups.map(([members, table]) => table[members.map((i) => this.chosen[i]).join()]);
    return all.every(Boolean) ? all : undefined;
  }

  // Choose the value with a number, unless it does not go with the others.
  choose(i, number) {
    const before = this.chosen[i];
    this.chosen[i] = number;
    if (!this.effects) this.chosen[i] = before;
  }

  get path() {
    return this.data.paths.find((path) => path.speed === this.value(SPEED, 1));
  }

  // The largest number of ticks: more than the path has where a policy slows it.
  get ticks() {
    const slows = this.data.slow.includes(this.value("control.at_singularity", this.data.policy));
    return slows ? Math.ceil(this.data.longest * this.path.ticks) : this.path.ticks;
  }

  isRead(control) {
    const isMet = (condition) =>
      Object.entries(condition).every(([key, names]) => names.includes(this.value(key)));
    return control.reads.length === 0 || control.reads.some(isMet);
  }

  // The values that differ, by their keys.
  get changes() {
    const differ = this.controls.filter((control, i) => this.chosen[i] !== control.start);
    return Object.fromEntries(differ.map((control) => [control.key, this.value(control.key)]));
  }

  // Choose what an address says after its #.
  read(address) {
    const wanted = new URLSearchParams(address);
    this.reset();
    this.controls.forEach((control, i) => {
      const number = control.values.findIndex((value) => String(value) === wanted.get(control.key));
      if (number >= 0) this.choose(i, number);
    });
  }

  get yaml() {
    const scenario = structuredClone(this.data.scenario),
      { [SPEED]: _, ...changes } = this.changes;
    for (const [key, value] of Object.entries({ ...changes, ...this.path.changes })) {
      const steps = key.split("."),
        last = steps.pop();
      steps.reduce((node, step) => (node[step] ??= {}), scenario)[last] = value;
    }
    return yaml(scenario);
  }
}
