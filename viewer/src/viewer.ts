// Composition of the page: each message is stored until the next drawing, drawn, and acknowledged.

import { Control } from "./control";
import { NodulePointer } from "./input/nodule_pointer";
import { PaintPointer } from "./input/paint_pointer";
import { Pointer } from "./input/pointer";
import { listenToKeys } from "./input/keyboard";
import { PictureKeys } from "./input/picture_keys";
import { TouchPan } from "./input/touch_pan";
import type { Carrier, ConnectionHandlers, ConnectionState } from "./net/carrier";
import { FrameQueue } from "./net/frame_queue";
import type { SceneData } from "./net/protocol";
import { Painting } from "./painting";
import { Setup } from "./setup";
import { Stage } from "./scene/stage";
import { sidesOf } from "./scene/surface";
import { Viewport } from "./scene/viewport";
import { Store } from "./store";
import { installPageInterface } from "./page_interface";
import { byId } from "./ui/dom";
import { ExamPanel } from "./ui/exam_panel";
import { fillHelp, toggleHelp } from "./ui/help";
import { showHint } from "./ui/hint";
import { Legend } from "./ui/legend";
import { MotionPanel } from "./ui/motion_panel";
import { followNotices } from "./ui/notices";
import { PaintMarks } from "./ui/paint_overlay";
import { PaintPanel } from "./ui/paint_panel";
import { Panel } from "./ui/panel";
import { Plots } from "./ui/plots";
import { RecordButton } from "./ui/record_button";
import { Readout } from "./ui/readout";
import { DropZone } from "./ui/drop_zone";
import { followSeries } from "./ui/series_note";
import { SetupPanel } from "./ui/setup_panel";
import { ScaleView } from "./ui/scale_view";
import { SettingsPanel } from "./ui/settings_panel";
import { SpokenForce } from "./ui/spoken_force";
import { Statistics } from "./ui/statistics";
import { TimeLine } from "./ui/time_line";
import { followTheme } from "./ui/theme";
import { ToolPanel } from "./ui/tool_panel";
import { ViewLink } from "./view_link";

export class Viewer {
  private readonly store = new Store();
  private readonly connection: Carrier;
  private readonly frames = new FrameQueue((frame) => this.connection.send({ type: "ack", frame }));
  private readonly control = new Control(this.store, (message) => this.connection.send(message));
  private readonly setup = new Setup(
    this.store,
    (message) => this.connection.send(message),
    (bytes) => this.connection.sendBytes(bytes),
    (text) => this.control.notice(text),
  );
  private readonly stage: Stage;
  private readonly pointer: Pointer;
  private readonly plots: Plots;
  private readonly statistics: Statistics;

  constructor(carrier: (handlers: ConnectionHandlers) => Carrier) {
    const { store, control } = this;
    this.connection = carrier({
      onState: (state) => this.receiveConnection(state),
      onText: (message) => {
        this.setup.receive(message);
        control.receiveText(message);
      },
      onScene: (scene) => this.receiveScene(scene),
      onFrame: (frame) => this.frames.push(frame),
      onUnreadable: (reason) => control.notice(`A message could not be read: ${reason}`),
    });
    const viewport = new Viewport(
      byId<HTMLCanvasElement>("canvas"),
      ["readout", "legend", "hint", "panel"].map((id) => byId(id)),
      () => this.receiveFrames(),
      () => this.frames.answer(),
    );
    this.stage = new Stage(viewport, store);
    const painting = new Painting(store, (message) => this.connection.send(message));
    // Before the pointers that paint and press.
    new NodulePointer(this.stage, store, this.setup);
    // Before the pointer that presses.
    new PaintPointer(this.stage, store, painting, new PaintMarks());
    this.pointer = new Pointer(this.stage, store, control);
    new TouchPan(viewport);
    new PictureKeys(viewport, store, (text) => control.notice(text));
    listenToKeys(control, painting, viewport, toggleHelp);
    // Before what reads its colours.
    followTheme(store, control);
    this.plots = new Plots(store);
    this.statistics = new Statistics(store);
    new Readout(store);
    new SpokenForce(store);
    new Legend(store, control);
    new ScaleView(viewport, store);
    new Panel(store, control, viewport);
    new SettingsPanel(store, control);
    new ToolPanel(store, control);
    new MotionPanel(store, control);
    new PaintPanel(store, painting);
    followSeries(store);
    new SetupPanel(store, this.setup, painting, (text) => control.notice(text));
    new DropZone(store, this.setup);
    new RecordButton(store, control);
    new TimeLine(store, control);
    new ExamPanel(store, control);
    followNotices(store, control);
    if (!this.connection.hasServer) new ViewLink(viewport, store);
    const { stage, pointer, statistics, connection } = this;
    installPageInterface({ store, stage, pointer, statistics, history: this.plots.history, carrier: connection });
  }

  start(): void {
    showHint(this.store);
    fillHelp();
    this.connection.open();
  }

  private receiveConnection(connection: ConnectionState): void {
    this.store.update({ connection });
    if (connection === "open") this.control.sendView();
    if (connection === "lost" || connection === "refused") {
      this.control.release();
      this.frames.clear();
    }
  }

  private receiveScene(data: SceneData): void {
    // Frames of the scene before are not drawn any more, but the server still counts on an answer.
    this.frames.take();
    const again = data.header.name === this.store.get().scene?.name;
    // With another tool on the same body a press goes on.
    const held = again ? this.pointer.held : null;
    this.control.receiveScene(data.header);
    this.store.update({ sizes: data.bodies.map(({ nodes }) => sidesOf(nodes)) });
    this.stage.setScene(data);
    if (held) this.pointer.pressAgain(held);
    document.title = `${data.header.title} · Palpate`;
  }

  /** Takes in what has arrived since the last drawing: all of the log, and the newest frame. Returns whether the picture changes. */
  private receiveFrames(): boolean {
    const frames = this.frames.take();
    const newest = frames.at(-1);
    if (!newest) return false;
    for (const frame of frames) this.plots.append(frame);
    const changed = this.statistics.timed(() => this.stage.update(newest));
    this.control.receiveFrame(newest.header);
    return changed;
  }
}
