// Starts the page with the token of its address. The token stands behind `#`, which browsers never send to a server.

import "./ui/style.css";
import "./ui/readout.css";
import "./ui/more.css";
import "./ui/session.css";
import "./ui/paint.css";
import "./ui/setup.css";

import { showConnection, showPageMessage } from "./ui/notices";
import { Viewer } from "./viewer";

function start(): void {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  // An address pasted over this one changes only what stands behind `#`: the browser would not load the page again.
  window.addEventListener("hashchange", () => location.reload());
  if (!token) {
    showConnection("refused");
    return;
  }
  try {
    new Viewer(token).start();
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    showPageMessage(`This browser cannot show the page, it needs WebGL 2 (${reason}).`);
  }
}

start();
