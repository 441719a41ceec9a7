// Run the images in some files in Node, and write the columns of each, as base64, beside it.
import fs from "fs";

const [law, wasm, ...files] = process.argv.slice(2);
const { World } = await import(law);
const module = new WebAssembly.Module(fs.readFileSync(wasm));
for (const file of files) {
  const world = new World(module, JSON.parse(fs.readFileSync(file)));
  const read = () => {
    while (world.advance(1000));
    const columns = Object.entries(world.columns());
    return JSON.stringify(
      Object.fromEntries(columns.map(([name, [, values]]) => [name, Buffer.from(values.buffer).toString("base64")])),
    );
  };
  const text = read();
  world.begin();
  if (read() !== text) throw new Error("the second run differs from the first");
  fs.writeFileSync(`${file}.columns`, text);
}
