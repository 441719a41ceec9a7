// Run the images in some files in Node, and write the columns of each, as base64, beside it.
import fs from "fs";

const [law, wasm, ...files] = process.argv.slice(2);
const { World } = await import(law);
const module = new WebAssembly.Module(fs.readFileSync(wasm));

// The columns of all finished ticks, by name.
function columnsOf(world) {
  const { done, image, arrays } = world;
  const table = world.array("columns"), columns = {};
  const integers = new BigInt64Array(table.buffer, table.byteOffset, table.length);
  for (const [name, [first, width]] of Object.entries(image.columns)) {
    const size = width || 1, source = name === "status" ? integers : table;
    columns[name] = Float64Array.from({ length: done * size }, (_, i) =>
      Number(source[Math.floor(i / size) * image.width + first + (i % size)]));
  }
  if (arrays.positions) columns.qpos = world.array("positions").slice(0, done * image.nq);
  return columns;
}

for (const file of files) {
  const world = new World(module, JSON.parse(fs.readFileSync(file)));
  const read = () => {
    while (world.advance(1000));
    const columns = Object.entries(columnsOf(world));
    return JSON.stringify(
      Object.fromEntries(columns.map(([name, values]) => [name, Buffer.from(values.buffer).toString("base64")])),
    );
  };
  const text = read();
  world.begin();
  if (read() !== text) throw new Error("the second run differs from the first");
  fs.writeFileSync(`${file}.columns`, text);
}
