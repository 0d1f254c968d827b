// Makes ../viewer.min.js, ../loader.min.js and ../live.min.js of the modules in source/: `npm ci && npm run build`. The same bytes on any machine.

import { build } from "esbuild";
import { readFile } from "node:fs/promises";

/** three.js without the shaders of its own materials: everything here is drawn with those of source/shaders.js. */
const withoutShaders = {
  name: "without-shaders",
  setup(steps) {
    steps.onLoad({ filter: /three[/\\]build[/\\]three\.module\.js$/ }, async ({ path }) => {
      const text = await readFile(path, "utf-8");
      const shader = /^((?:const|var) [\w$]+ = )"((?:[^"\\]|\\.)*\\n(?:[^"\\]|\\.)*)";$/gm;
      let count = 0;
      const contents = text.replace(shader, (whole, name, body) => {
        const isShader = /#if|#include|uniform |varying |vec[234]|float /.test(body);
        // Every shader of a page gets this one.
        if (!isShader || body.includes("sRGBTransferOETF")) return whole;
        count += 1;
        return `${name}"";`;
      });
      if (count < 100) throw new Error(`only ${count} shaders found in ${path}: look how this version holds them`);
      return { contents, loader: "js" };
    });
  },
};

for (const [entry, made] of [["main", "viewer"], ["loader", "loader"], ["live/live", "live"]]) {
  await build({
    entryPoints: [`source/${entry}.js`],
    outfile: `../${made}.min.js`,
    bundle: true,
    minify: true,
    format: "iife",
    target: "es2022",
    charset: "ascii",
    legalComments: "none",
    plugins: [withoutShaders],
  });
}
