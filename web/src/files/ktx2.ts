/** Textures in KTX2 (KHR_texture_basisu), by Basis Universal's transcoder: loaded when needed. */

import { LoadingManager, type WebGLRenderer } from "three";
import { KTX2Loader } from "three/addons/loaders/KTX2Loader.js";
import { localProblem } from "../api/problem";

const WORKERS = 2;

// One for the page's life: each holds workers of its own.
let shared: KTX2Loader | null = null;

/**
 * A loader of textures whose addresses `locate` turns into those of the files at hand. Rejects where
 * the transcoder does not come; the next call asks for it again.
 */
export async function ktx2Loader(locate: (url: string) => string): Promise<KTX2Loader> {
  shared ??= new KTX2Loader(transcoderAlone())
    .setTranscoderPath("./")
    .setWorkerLimit(WORKERS)
    .detectSupport(compressedFormats());
  const loader = shared;
  try {
    await loader.init();
  } catch {
    // It would keep its failure.
    if (shared === loader) shared = null;
    loader.dispose();
    throw localProblem("The textures cannot be read", "Their transcoder did not come. Is the service up?");
  }
  return {
    isKTX2Loader: true,
    load: (...[url, ...rest]: Parameters<KTX2Loader["load"]>) => loader.load(locate(url), ...rest),
    parse: loader.parse.bind(loader),
  } as unknown as KTX2Loader;
}

/** Textures are blobs; what else is asked for is the transcoder, whose files carry hashes. */
function transcoderAlone(): LoadingManager {
  const at = (path: string): string => new URL(path, import.meta.url).href;
  return new LoadingManager().setURLModifier((url) => {
    if (url.startsWith("blob:")) return url;
    return at(url.endsWith(".wasm") ? BASIS_WASM : BASIS_WRAPPER);
  });
}

/** What the loader asks a renderer: which compressed formats the card takes. */
function compressedFormats(): WebGLRenderer {
  const gl = document.createElement("canvas").getContext("webgl2");
  const extensions = new Map<string, unknown>();
  for (const name of gl?.getSupportedExtensions() ?? []) extensions.set(name, gl?.getExtension(name));
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return { extensions } as unknown as WebGLRenderer;
}
