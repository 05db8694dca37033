// A page without a server: what `palpate web` and `palpate.widget` write into its head, its address, and its files for the next
// visit.

import type { Site } from "./net/worker_carrier";
import type { Choice } from "./net/protocol";

/** Scenes of a folder beside the page: their names have no slash. */
const SCENE_NAME = /^[\w-]+$/;

/** Addresses of files that are not beside the page, as in a notebook. */
interface Files {
  program: string;
  worker: string;
  scene: string;
}

function meta(name: string): string | null {
  return document.querySelector<HTMLMetaElement>(`meta[name="palpate-${name}"]`)?.content ?? null;
}

/** Null where a server brings the scene. */
export function siteOfPage(): Site | null {
  const first = meta("scene");
  if (!first) return null;
  const models = JSON.parse(meta("scenes") ?? "[]") as Choice[];
  const given = meta("files");
  if (given) {
    const { program, worker, scene } = JSON.parse(given) as Files;
    return { program, worker, scene: first, models, sceneUrl: () => scene };
  }
  const url = (path: string) => new URL(path, document.baseURI).href;
  const asked = new URLSearchParams(location.search).get("scene");
  const scene = asked && SCENE_NAME.test(asked) ? asked : first;
  return { program: url("palpate.wasm"), worker: null, scene, models, sceneUrl: (name) => url(`scenes/${name}.palpate`) };
}

/** The address names the scene that is open, without the view of the one before. */
export function showSceneInAddress(name: string): void {
  const asked = new URLSearchParams(location.search);
  if (asked.get("scene") === name) return;
  asked.set("scene", name);
  history.replaceState(null, "", `?${asked.toString()}`);
}

/** Keeps the files of the open scene for the next visit, without a network too. */
export async function keepFiles(site: Site, scene: string): Promise<void> {
  if (site.worker || !("serviceWorker" in navigator)) return;
  await navigator.serviceWorker.register("./sw.js");
  const { active } = await navigator.serviceWorker.ready;
  const fetched = performance.getEntriesByType("resource").map(({ name }) => name);
  active?.postMessage([new URL("./", location.href).href, location.href.split("#")[0], ...fetched, site.program, site.sceneUrl(scene)]);
}
