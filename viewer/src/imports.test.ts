import { expect, it } from "vitest";

const SOURCES = import.meta.glob<string>(["./**/*.ts", "!./**/*.test.ts"], { query: "?raw", import: "default", eager: true });
/** Of values and of types alike: a circle of types couples two files as well. */
const IMPORT = /^(?:import|export)\b[^;]*?\bfrom "(\.[^"]*)"/gm;

/** Files that a file imports, as keys of the sources. */
function importsOf(sources: Record<string, string>, file: string): string[] {
  const folder = file.slice(0, file.lastIndexOf("/") + 1);
  return [...sources[file]!.matchAll(IMPORT)].map(([, name]) => {
    const { pathname } = new URL(`${folder}${name}.ts`, "file:///");
    return `.${pathname}`;
  });
}

/** A circle of imports, as the files along it; null where there is none. */
function circle(sources: Record<string, string>): string[] | null {
  const done = new Set<string>();
  const visit = (file: string, path: string[]): string[] | null => {
    if (path.includes(file)) return [...path.slice(path.indexOf(file)), file];
    if (done.has(file)) return null;
    for (const imported of importsOf(sources, file)) {
      const found = visit(imported, [...path, file]);
      if (found) return found;
    }
    done.add(file);
    return null;
  };
  for (const file of Object.keys(sources)) {
    const found = visit(file, []);
    if (found) return found;
  }
  return null;
}

it("no file imports itself by way of others", () => {
  expect(importsOf(SOURCES, "./viewer.ts")).toContain("./ui/panel.ts");
  const missing = Object.keys(SOURCES).flatMap((file) => importsOf(SOURCES, file).filter((name) => !(name in SOURCES)));
  expect(missing).toEqual([]);
  expect(circle(SOURCES)).toBeNull();
});

it("a circle is found, of types as well", () => {
  const sources = {
    "./a.ts": 'import { b } from "./x/b";\nimport "./style.css";',
    "./x/b.ts": 'import type {\n  C,\n} from "../c";',
    "./c.ts": 'export { a } from "./a";',
  };
  expect(circle(sources)).toEqual(["./a.ts", "./x/b.ts", "./c.ts", "./a.ts"]);
  expect(circle({ ...sources, "./c.ts": "" })).toBeNull();
});
