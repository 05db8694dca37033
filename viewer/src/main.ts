// Starts the page with the token of its address. The token stands behind `#`, which browsers never send to a server.

import "./ui/style.css";
import "./ui/readout.css";
import "./ui/more.css";
import "./ui/session.css";
import "./ui/paint.css";
import "./ui/setup.css";

import { Connection } from "./net/connection";
import { WorkerCarrier } from "./net/worker_carrier";
import type { Site } from "./net/worker_carrier";
import { keepFiles, showSceneInAddress, siteOfPage } from "./site";
import { showConnection, showPageMessage } from "./ui/notices";
import { Viewer } from "./viewer";

function startPacked(site: Site): void {
  const listener = {
    onOpened: (scene: string) => {
      if (site.models.length > 0) showSceneInAddress(scene);
      void keepFiles(site, scene).catch(() => undefined);
    },
    onFailure: (reason: string) => showPageMessage(`This page cannot run the scene: ${reason}`),
  };
  new Viewer((handlers) => new WorkerCarrier(site, handlers, listener)).start();
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
  const site = siteOfPage();
  try {
    if (site === null) startFromServer();
    else startPacked(site);
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    showPageMessage(`This browser cannot show the page, it needs WebGL 2 (${reason}).`);
  }
}

start();
