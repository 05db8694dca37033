// A tone whose amplitude is the force, in place of touch where only a mouse is connected. Differences of amplitude that
// an ear tells apart are about as large a part of it as differences of force for a hand.

const PITCH_HZ = 220;
/** Of the loudest tone, of what the system puts out. */
const VOLUME = 0.5;
/** The amplitude follows this fast, s: between frames it must not crackle. */
const LAG_S = 0.015;

export class ForceTone {
  wanted = true;
  private sound: { context: AudioContext; gain: GainNode } | null = null;

  constructor() {
    // Browsers let a page sound only after it was touched.
    window.addEventListener("pointerdown", () => this.start(), { capture: true });
  }

  /** loudness goes from 0 to 1. */
  play(loudness: number): void {
    if (!this.sound) return;
    const { context, gain } = this.sound;
    gain.gain.setTargetAtTime(this.wanted ? VOLUME * loudness : 0, context.currentTime, LAG_S);
  }

  private start(): void {
    if (this.sound || !document.body.hasAttribute("data-exam")) return;
    const context = new AudioContext();
    const gain = new GainNode(context, { gain: 0 });
    const tone = new OscillatorNode(context, { type: "triangle", frequency: PITCH_HZ });
    tone.connect(gain).connect(context.destination);
    tone.start();
    this.sound = { context, gain };
  }
}
