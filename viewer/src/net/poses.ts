// Poses of bodies in 16 bits, as differences from the frame before (`python/palpate/viewer/pose_code.py`).

/** How the pose of a body is coded: `base` is the frame that it differs from, null for a whole one; the step in m. */
export interface PoseMessage {
  rows: number;
  step: number;
  base: number | null;
}

/**
 * Of one body. `moved` and `colored` are masks of the rows that differ from the base, the lowest bit of a byte first: `steps`
 * are the differences of the first, three a row, `scalar` the values of the second. Of a whole pose all rows are there, and
 * masks are empty.
 */
export interface CodedArrays {
  moved: Uint8Array;
  steps: Int8Array | Int16Array;
  colored: Uint8Array;
  scalar: Uint8Array;
}

/** Of one body: a row of displacements, m, and scalar is a surface node, or any node if the inside is shown. */
export interface PoseArrays {
  displacements: Float32Array;
  scalar: Uint8Array;
}

interface Known {
  frame: number;
  steps: Int16Array;
  scalar: Uint8Array;
}

/** Undoes the code, frame after frame: every one that arrives must be given, also those that are not drawn. */
export class PoseReader {
  private known: Known[] = [];

  /** Poses of a frame; null where it differs from a frame that is not known here. */
  read(frame: number, poses: readonly PoseMessage[], bodies: readonly CodedArrays[]): PoseArrays[] | null {
    const known = bodies.map((coded, body) => this.added(frame, body, poses[body], coded));
    if (!known.every((one) => one !== null)) {
      this.known = [];
      return null;
    }
    this.known = known;
    return known.map(({ steps, scalar }, body) => ({ displacements: scaled(steps, poses[body]!.step), scalar }));
  }

  private added(frame: number, body: number, pose: PoseMessage | undefined, coded: CodedArrays): Known | null {
    if (!pose) return null;
    if (pose.base === null) {
      const whole = coded.steps.length === 3 * pose.rows && coded.scalar.length === pose.rows;
      return whole ? { frame, steps: Int16Array.from(coded.steps), scalar: coded.scalar } : null;
    }
    const base = this.known[body];
    if (base?.frame !== pose.base || base.scalar.length !== pose.rows) return null;
    const [steps, scalar] = [base.steps.slice(), base.scalar.slice()];
    if (coded.steps.length !== 3 * countBits(coded.moved) || coded.scalar.length !== countBits(coded.colored)) return null;
    addRows(steps, coded.moved, coded.steps);
    setRows(scalar, coded.colored, coded.scalar);
    return { frame, steps, scalar };
  }
}

// Loops by index, without calls for each number: a frame may have a hundred thousand.

function scaled(steps: Int16Array, step: number): Float32Array {
  const displacements = new Float32Array(steps.length);
  for (let i = 0; i < steps.length; i++) displacements[i] = steps[i]! * step;
  return displacements;
}

function countBits(mask: Uint8Array): number {
  let count = 0;
  for (let byte = 0; byte < mask.length; byte++) for (let bits = mask[byte]!; bits !== 0; bits &= bits - 1) count += 1;
  return count;
}

/** Adds differences to the rows of a mask; sums in an array of 16 bits wrap as the differences did. */
function addRows(steps: Int16Array, mask: Uint8Array, differences: Int8Array | Int16Array): void {
  let from = 0;
  for (let byte = 0; byte < mask.length; byte++) {
    for (let bits = mask[byte]!; bits !== 0; bits &= bits - 1, from += 3) {
      const at = 3 * (8 * byte + lowestBit(bits));
      steps[at]! += differences[from]!;
      steps[at + 1]! += differences[from + 1]!;
      steps[at + 2]! += differences[from + 2]!;
    }
  }
}

function setRows(values: Uint8Array, mask: Uint8Array, changed: Uint8Array): void {
  let from = 0;
  for (let byte = 0; byte < mask.length; byte++) {
    for (let bits = mask[byte]!; bits !== 0; bits &= bits - 1) values[8 * byte + lowestBit(bits)] = changed[from++]!;
  }
}

function lowestBit(bits: number): number {
  return 31 - Math.clz32(bits & -bits);
}
