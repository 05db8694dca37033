// The tools of a packed scene as they are now: the shapes that each may take, and what follows from a choice for the scene
// message, for a recording and for the loop.

import { decodeArrays, encodeArrays } from "../net/protocol";
import type { AnyArray, ToolMessage } from "../net/protocol";
import type { PageData, PackedShape } from "./scene_package";

export class OfferedTools {
  private readonly header: Record<string, unknown>;
  private readonly arrays: Record<string, AnyArray>;
  private readonly own: ToolMessage[];
  /** Another shape than the scene's own, of each tool that has one. */
  private readonly chosen = new Map<number, PackedShape>();

  constructor(
    private readonly data: PageData,
    sceneMessage: ArrayBuffer,
  ) {
    const { header, arrays } = decodeArrays(sceneMessage);
    this.header = header;
    this.arrays = Object.fromEntries(arrays);
    this.own = header["tools"] as ToolMessage[];
  }

  /** Gives a tool an offered shape; what the loop has to know of it, undefined for the scene's own tool. */
  choose(tool: number, name: string): object | undefined {
    const [own, offered] = [this.own[tool], this.data.shapes[tool]?.[name]];
    if (!own) throw new Error(`shape: there is no tool ${tool}`);
    if (!offered && name !== own.shape) throw new Error(`shape: this tool is no '${name}'`);
    if (offered) this.chosen.set(tool, offered);
    else this.chosen.delete(tool);
    return offered?.description;
  }

  /** The scene message with the tools as they are. */
  sceneMessage(): ArrayBuffer {
    const arrays = { ...this.arrays };
    const tools = this.own.map((own, tool) => {
      const chosen = this.chosen.get(tool);
      if (!chosen) return own;
      // Only a shape of a file has arrays.
      arrays[`tools/${tool}/vertices`] = new Float32Array();
      arrays[`tools/${tool}/triangles`] = new Uint32Array();
      return { ...own, ...chosen.entry };
    });
    return encodeArrays({ ...this.header, tools }, arrays);
  }

  /** What a recording says of itself: the tables of its scene have the tools as they are. */
  about(): Record<string, string> {
    const scene = JSON.parse(this.data.about["scene"]!) as { tool: object[] };
    this.chosen.forEach(({ table }, tool) => (scene.tool[tool] = table));
    return { ...this.data.about, scene: JSON.stringify(scene) };
  }
}
