// Messages about a body that is set up in the page. Lengths in m, stiffness in Pa.

type Vec3 = [number, number, number];

/** A material of which a measurement was published. */
export interface Tissue {
  name: string;
  title: string;
  youngs_modulus: number;
  /** Standard deviation of the source; 0 for none. */
  spread: number;
  poissons_ratio: number;
  source: string;
}

/** Supports lie between a side of the body's box and a plane along it, so deep from that side. */
export interface SupportPlane {
  axis: 0 | 1 | 2;
  above: boolean;
  depth: number;
}

export interface Nodule {
  center: Vec3;
  radius: number;
  youngs_modulus: number;
}

/** A segment of a label map within the largest one, and the name of its material. */
export interface SegmentChoice {
  name: string;
  tissue: string;
}

export interface SetupBody {
  name: string;
  file: string;
  /** null while it is to be chosen. */
  unit: string | null;
  /** Sides of the body in each unit. */
  units: { unit: string; size: Vec3 }[];
  /** Units that it may be in, the likeliest first. */
  fitting: string[];
  size: Vec3;
  /** Corner of its box. */
  low: Vec3;
  /** Whether its tetrahedra are made: before, only its surface is known. */
  filled: boolean;
  nodes: number;
  tets: number;
  /** What the mesher did and lost, a line each. */
  notes: string[];
  /** Whether the supports are those painted; else those behind the plane. */
  painted: boolean;
  /** Painted surface nodes, as a mask (`nodesOfMask`); null for none. */
  held: string | null;
  plane: SupportPlane;
  tissue: string | null;
  youngs_modulus: number;
  poissons_ratio: number;
  /** Of the tool. */
  radius: number;
  nodule: Nodule | null;
  /** All segments but the largest, which has the material of the body. */
  segments: SegmentChoice[];
  /** Path of the scene that was saved and still is what is chosen. */
  saved: string | null;
}

/** Sent when a page opens, and whenever something of it changes elsewhere. */
export interface SetupMessage {
  type: "setup";
  /** Bytes of the largest file that is taken; 0 where none is. */
  limit: number;
  /** Bytes of a part of it at most. */
  part: number;
  endings: string[];
  tissues: Tissue[];
  /** Whether a body is set up, or awaited; else one is touched. */
  editing: boolean;
  /** Whether a scene is being prepared, of which nothing can be touched yet. */
  preparing: boolean;
  body: SetupBody | null;
}

/** So many bytes of the file have come: the next part may. */
export interface UploadedMessage {
  type: "uploaded";
  bytes: number;
}

export type SetupChange = Partial<Pick<SetupBody, "painted" | "plane" | "tissue" | "radius" | "nodule" | "segments">> & { unit?: string };

export type SetupCommand =
  | { type: "upload"; name: string; size: number }
  | ({ type: "setup" } & SetupChange)
  /** Painted supports from surface node `first` on, a multiple of 8, as a mask. */
  | { type: "hold"; first: number; nodes: string }
  | { type: "touch" }
  | { type: "edit" }
  | { type: "save" };
