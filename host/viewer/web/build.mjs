// Bundles the page and writes it as a C++ source: argument 1 is the file to be written.
import { build } from "esbuild";
import { readFileSync, writeFileSync } from "node:fs";

const bundle = await build({
  entryPoints: ["src/page.ts"],
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  charset: "utf8",
  legalComments: "eof",
  write: false,
});

// [name below the token's folder, type, content]
const files = [
  ["", "text/html; charset=utf-8", readFileSync("src/page.html")],
  ["page.js", "text/javascript; charset=utf-8", Buffer.from(bundle.outputFiles[0].contents)],
  ["page.css", "text/css; charset=utf-8",
    Buffer.concat(["node_modules/uplot/dist/uPlot.min.css", "src/page.css"].map((path) => readFileSync(path)))],
  ["icon.svg", "image/svg+xml", readFileSync("src/icon.svg")],
];

// C++ string literal. Bytes that are not printable become octal escapes.
function literal(bytes) {
  let text = "";
  for (const byte of bytes) {
    const plain = byte >= 32 && byte < 127 && byte !== 34 && byte !== 92 && byte !== 63;
    text += plain ? String.fromCharCode(byte) : `\\${byte.toString(8).padStart(3, "0")}`;
  }
  if (text === "") return `    ""`;
  const lines = text.match(/(?:\\[0-7]{3}|[^\\]){1,400}/g) ?? [];
  return lines.map((line) => `    "${line}"`).join("\n");
}

const entries = files.map(
  ([name, type, bytes]) => `{"${name}", "${type}", std::string_view(\n${literal(bytes)},\n    ${bytes.length})}`,
);
writeFileSync(
  process.argv[2],
  `// Made by host/viewer/web/build.mjs.
#include "host/viewer/page_files.h"

namespace torquer::viewer {

std::span<const PageFile> PageFiles() {
  static constexpr PageFile kFiles[] = {
  ${entries.join(",\n  ")}};
  return kFiles;
}

}  // namespace torquer::viewer
`,
);
