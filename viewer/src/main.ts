// Starts the page with the token of its address. The token stands behind `#`, which browsers never send to a server.

import "./ui/style.css";
import "./ui/readout.css";
import "./ui/more.css";
import "./ui/session.css";
import "./ui/paint.css";
import "./ui/setup.css";

import { Connection } from "./net/connection";
import { WorkerCarrier } from "./net/worker_carrier";
import { showConnection, showPageMessage } from "./ui/notices";
import { Viewer } from "./viewer";

/** Scenes of a folder beside the page: their names have no slash. */
const SCENE_NAME = /^[\w-]+$/;

/** The scene of a page without a server, which `palpate web` writes into the page; null where a server brings it. */
function packedScene(): string | null {
  const content = document.querySelector<HTMLMetaElement>('meta[name="palpate-scene"]')?.content;
  if (!content) return null;
  const asked = new URLSearchParams(location.search).get("scene");
  return asked && SCENE_NAME.test(asked) ? asked : content;
}

function startPacked(name: string): void {
  const url = (path: string) => new URL(path, document.baseURI).href;
  const failed = (reason: string) => showPageMessage(`This page cannot run the scene: ${reason}`);
  new Viewer((handlers) => new WorkerCarrier(url("palpate.wasm"), url(`scenes/${name}.palpate`), handlers, failed)).start();
  // For the next visit, without a network too.
  void keepFiles().catch(() => undefined);
}

async function keepFiles(): Promise<void> {
  if (!("serviceWorker" in navigator)) return;
  await navigator.serviceWorker.register("./sw.js");
  const { active } = await navigator.serviceWorker.ready;
  const fetched = performance.getEntriesByType("resource").map(({ name }) => name);
  const ofWorker = ["palpate.wasm", `scenes/${packedScene()}.palpate`].map((path) => new URL(path, document.baseURI).href);
  active?.postMessage([location.href.split("#")[0], ...fetched, ...ofWorker]);
}

function startFromServer(): void {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  // An address pasted over this one changes only what stands behind `#`: the browser would not load the page again.
  window.addEventListener("hashchange", () => location.reload());
  if (!token) {
    showConnection("refused");
    return;
  }
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  new Viewer((handlers) => new Connection(`${scheme}://${location.host}/socket`, token, handlers)).start();
}

function start(): void {
  const packed = packedScene();
  try {
    if (packed === null) startFromServer();
    else startPacked(packed);
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    showPageMessage(`This browser cannot show the page, it needs WebGL 2 (${reason}).`);
  }
}

start();
