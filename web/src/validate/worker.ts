/** Khronos' glTF Validator, off the page's thread. */

import { validateBytes } from "gltf-validator";
import { pathOf } from "../files/path";

export interface Request {
  bytes: ArrayBuffer;
  neighbours: Map<string, Blob>;
}

self.onmessage = async ({ data }: MessageEvent<Request>) => {
  try {
    const outcome = await validateBytes(new Uint8Array(data.bytes), {
      maxIssues: 1000,
      writeTimestamp: false,
      externalResourceFunction: async (uri) => {
        const file = data.neighbours.get(pathOf(uri));
        if (!file) throw new Error(`${uri} is not among the files`);
        return new Uint8Array(await file.arrayBuffer());
      },
    });
    self.postMessage({ outcome });
  } catch (error) {
    self.postMessage({ failure: String(error) });
  }
};
