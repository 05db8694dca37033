// The page: what arrives is kept until the next drawing, drawn, and acknowledged; what the user does is sent.

import { BodyView } from "./body_view";
import { ColorMap } from "./color_map";
import { Connection } from "./connection";
import type { ConnectionState } from "./connection";
import { facingAxis } from "./cut_plane";
import { byId } from "./dom";
import { tissueColor } from "./field_material";
import { showHint } from "./hint";
import { listenToKeys } from "./keyboard";
import { Legend } from "./legend";
import { MotionPanel } from "./motion_panel";
import { showConnection, showFault, showNotice, showRole, showStatus } from "./notices";
import { Panel } from "./panel";
import { Plots } from "./plots";
import { Press } from "./press";
import type { FrameData, FrameMessage, MotionScene, Role, SceneData, TextMessage } from "./protocol";
import { Readout } from "./readout";
import { download } from "./screenshot";
import { Statistics } from "./statistics";
import { installTestHooks } from "./test_hooks";
import type { ViewerState } from "./test_hooks";
import { ToolView } from "./tool_view";
import { Viewport } from "./viewport";
import { WatchedView } from "./watched_view";

/** The scene's own blow waits until the body has been seen at rest. */
const FIRST_BLOW_MS = 800;

export class Viewer {
  private body: BodyView | null = null;
  private tool: ToolView | null = null;
  private watched: WatchedView | null = null;
  private role: Role = "watch";
  private connectionState: ConnectionState = "connecting";
  private pending: FrameData[] = [];
  private drawn: number[] = [];
  private frame: FrameMessage | null = null;
  private framesApplied = 0;
  private readonly field = { colorMap: { value: ColorMap.sequential.texture }, fieldShown: { value: 1 } };
  private fieldName: string | null = null;
  private readonly viewport = new Viewport(
    byId<HTMLCanvasElement>("canvas"),
    ["readout", "legend", "hint"].map((id) => byId(id)),
    () => this.takeFrames(),
    () => this.acknowledge(),
  );
  private readonly readout = new Readout();
  private readonly legend = new Legend();
  private readonly statistics = new Statistics();
  private readonly plots = new Plots();
  private readonly connection: Connection;
  private readonly panel: Panel;
  private readonly motion: MotionPanel;
  private firstBlow = 0;
  private readonly press: Press;

  constructor(token: string) {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.connection = new Connection(`${scheme}://${location.host}/socket`, token, {
      onState: (state) => this.setConnection(state),
      onText: (message) => this.takeText(message),
      onScene: (scene) => this.takeScene(scene),
      onFrame: (frame) => this.pending.push(frame),
      onUnreadable: (reason) => showNotice(`A message could not be read: ${reason}`),
    });
    this.panel = this.createPanel();
    this.motion = new MotionPanel({
      send: (message) => this.connection.send(message),
      onPlots: (pair) => this.plots.show(pair),
    });
    this.press = new Press(this.viewport, {
      body: () => (this.role === "control" && this.connectionState === "open" ? this.body : null),
      grabWanted: () => this.panel.grab,
      strikeWanted: () => this.motion.strike,
      onStrike: ({ settled, normal }) => {
        const impulse = normal.clone().multiplyScalar(-this.motion.impulse);
        this.connection.send({ type: "strike", point: settled.toArray(), impulse: impulse.toArray() });
      },
      onPress: (position, grab) => {
        this.connection.send({ type: "press", position, grab });
      },
      onRelease: () => {
        this.connection.send({ type: "release" });
        this.readout.updateDepth(null, false);
      },
    });
    this.listenToKeys();
    installTestHooks(this.viewport, () => this.body, () => this.state());
  }

  start(): void {
    showHint();
    this.connection.open();
  }

  private createPanel(): Panel {
    return new Panel({
      send: (message) => this.connection.send(message),
      onShown: (shown) => {
        this.plots.shown = shown.plots;
        this.applyShown();
      },
      onField: (name) => {
        this.fieldName = name;
        this.connection.send({ type: "field", name });
      },
      onCutaway: (on) => {
        this.connection.send({ type: "cutaway", on });
        if (on) this.panel.cutAcross(facingAxis(this.viewport.towardsViewer()));
      },
      onCut: (axis, share) => {
        this.body?.cutPlane.set(axis, share, this.viewport.towardsViewer());
        this.body?.applyCutPlane();
        this.viewport.invalidate();
      },
      onContactRadius: (radius) => this.setContactRadius(radius),
      onReset: () => this.reset(),
      onResetView: () => this.viewport.reframe(),
      onScreenshot: () => void this.saveScreenshot(),
    });
  }

  private listenToKeys(): void {
    const panel = this.panel;
    listenToKeys({
      r: () => this.reset(),
      v: () => this.viewport.reframe(),
      w: () => panel.toggle("wireframe"),
      c: () => panel.toggle("colors"),
      x: () => panel.toggle("cutaway"),
      s: () => panel.toggle("supports"),
      f: () => panel.nextField(),
      p: () => panel.toggle("plots"),
      g: () => panel.toggleGrab(),
      k: () => this.motion.toggleStrike(),
      Escape: () => {
        this.press.release();
        this.motion.endMode();
      },
    });
  }

  private setConnection(state: ConnectionState): void {
    this.connectionState = state;
    showConnection(state);
    if (state === "open") {
      // What this page looks at, told again after a connection was lost.
      if (this.panel.shown.cutaway) this.connection.send({ type: "cutaway", on: true });
      if (this.fieldName !== null) this.connection.send({ type: "field", name: this.fieldName });
    }
    if (state === "lost" || state === "refused") {
      this.press.release();
      this.pending = [];
    }
  }

  private takeText(message: TextMessage): void {
    switch (message.type) {
      case "welcome":
        byId("version").textContent = message.version;
        this.panel.setModels(message.models);
        return this.setRole(message.role);
      case "role":
        return this.setRole(message.role);
      case "settings":
        this.panel.setSettings(message.youngs_modulus, message.contact_radius);
        this.motion.setTimeScale(message.time_scale);
        return this.setContactRadius(message.contact_radius);
      case "status":
        return showStatus(message);
      case "error":
        return showNotice(message.text);
    }
  }

  private setRole(role: Role): void {
    this.role = role;
    if (role === "watch") this.press.release();
    this.panel.setRole(role);
    this.motion.setRole(role);
    showRole(role);
  }

  private takeScene(data: SceneData): void {
    this.press.release();
    // Frames of the body before are not drawn any more, but the server still counts on an answer.
    this.acknowledgeSoon(this.pending.splice(0));
    this.body?.dispose();
    this.tool?.dispose();
    const { header } = data;
    this.body = new BodyView(data, this.field);
    this.tool = new ToolView(header, this.body.surface);
    this.watched?.dispose();
    this.watched = new WatchedView(this.body.surface, header.size);
    this.viewport.scene.add(this.body.group, this.tool.group, this.watched.dot);
    this.viewport.frame(this.body.surface, header);
    this.plots.log.clear();
    this.plots.history.clear();
    this.plots.span = header.motion?.span ?? 1;
    this.panel.setScene(header);
    this.setMotion(header.motion);
    this.legend.setTissue(tissueColor(header.name).getStyle());
    if (this.panel.shown.cutaway) this.panel.cutAcross(facingAxis(this.viewport.towardsViewer()));
    this.applyShown();
    document.title = `${header.title} · Palpate`;
  }

  /**
   * Takes in what has arrived since the last drawing: all of the log, and the newest frame. Tells whether the picture
   * changes: a body at rest is not drawn again and again.
   */
  private takeFrames(): boolean {
    const frames = this.pending.splice(0);
    const newest = frames.at(-1);
    if (!newest) return false;
    for (const { arrays } of frames) {
      this.plots.log.append(arrays.log);
      this.plots.history.append(arrays.history);
    }
    this.acknowledgeSoon(frames);
    const { header } = newest;
    const bodyMoved = this.body?.update(newest) ?? false;
    const toolMoved = this.tool?.update(header) ?? false;
    this.frame = header;
    this.framesApplied += 1;
    this.showNumbers(header);
    this.showMotion(header);
    this.statistics.countFrame();
    this.statistics.update(header);
    this.plots.refresh();
    showFault(header.fault);
    return bodyMoved || toolMoved;
  }

  private showNumbers(frame: FrameMessage): void {
    const { wanted, position } = frame.tool;
    this.readout.update(frame.force, frame.strain, wanted ? (this.body?.data.header.hold_strain ?? null) : null);
    // While the tool is held back, its own depth is told, not that of the pointer.
    this.readout.updateDepth(this.press.depthOf(wanted ? position : null), this.press.grabbing);
    this.legend.update(frame.field);
    this.field.colorMap.value = (frame.field.signed ? ColorMap.diverging : ColorMap.sequential).texture;
  }

  private setMotion(motion: MotionScene | null): void {
    this.motion.setScene(motion);
    window.clearTimeout(this.firstBlow);
    if (!motion?.strike) return;
    this.firstBlow = window.setTimeout(() => {
      if (this.role === "control") this.connection.send({ type: "repeat" });
    }, FIRST_BLOW_MS);
  }

  private showMotion({ motion, tool }: FrameMessage): void {
    this.motion.showMode(motion?.mode ?? null);
    // The tool would hide the dot.
    this.watched?.update(motion && !tool.active ? motion.watched : null);
    const own = this.body?.data.header.motion?.strike;
    this.plots.origin = own ? (motion?.struck_at ?? null) : null;
  }

  private acknowledgeSoon(frames: FrameData[]): void {
    this.drawn.push(...frames.map((frame) => frame.header.frame));
  }

  private acknowledge(): void {
    for (const frame of this.drawn.splice(0)) this.connection.send({ type: "ack", frame });
  }

  private applyShown(): void {
    this.body?.show(this.panel.shown);
    this.legend.show(this.panel.shown);
    this.viewport.invalidate();
  }

  private setContactRadius(radius: number): void {
    if (this.tool) this.tool.contactRadius = radius;
    this.viewport.invalidate();
  }

  private reset(): void {
    this.press.release();
    if (this.role === "control") this.connection.send({ type: "reset" });
  }

  private async saveScreenshot(): Promise<void> {
    const picture = await this.viewport.toPng();
    if (picture) download(picture, this.body?.data.header.name ?? "empty");
    else showNotice("The browser could not save the picture.");
  }

  private state(): ViewerState {
    const { frame } = this;
    const force = frame?.force ?? [0, 0, 0];
    return {
      connected: this.connectionState === "open",
      role: this.role,
      scene: this.body?.data.header.name ?? null,
      force,
      forceMagnitude: Math.hypot(...force),
      contacts: frame?.contacts.length ?? 0,
      frames: this.framesApplied,
      frameNumber: frame?.frame ?? 0,
      framesPerSecond: this.statistics.framesPerSecond,
      pointerEvents: this.press.pointerEvents,
      ticks: frame?.ticks ?? 0,
      toolPosition: frame?.tool.position ?? null,
      depth: this.press.depthOf(null),
      strain: frame?.strain ?? 0,
      held: frame?.tool.wanted != null,
      field: frame?.field ?? null,
      fault: frame?.fault ?? null,
      motion: frame?.motion ? { ...frame.motion, ...this.plots.history.latest() } : null,
    };
  }
}
