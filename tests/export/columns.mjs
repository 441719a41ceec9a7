// Run the images in some files in Node, and write the columns of each, as base64, beside it.
import fs from "fs";

const [law, wasm, ...files] = process.argv.slice(2);
const { World } = await import(law);
const module = new WebAssembly.Module(fs.readFileSync(wasm));

// The columns of all ticks, by name, as base64.
function columnsOf(world, run) {
  const columns = {};
  for (const name of Object.keys(world.image.columns)) {
    const rows = Array.from({ length: run.count }, (_, k) => (name === "status" ? [run.status(k)] : [...run.row(name, k)]));
    columns[name] = Float64Array.from(rows.flat());
  }
  columns.qpos = world.array("positions").slice(0, run.count * world.image.nq);
  return Object.entries(columns).map(([name, values]) => [name, Buffer.from(values.buffer).toString("base64")]);
}

for (const file of files) {
  const { image, path, ticks } = JSON.parse(fs.readFileSync(file));
  const world = new World(module, image);
  const read = () => JSON.stringify(Object.fromEntries(columnsOf(world, world.run(path, [], ticks))));
  const text = read();
  if (read() !== text) throw new Error("the second run differs from the first");
  fs.writeFileSync(`${file}.columns`, text);
}
