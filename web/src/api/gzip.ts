/** Compress uploads: geometry as text shrinks to a third, images and compressed meshes hardly. */

import type { Body } from "./jobs";

/** Smaller bodies arrive in one packet or two anyway. */
const LEAST_BYTES = 4096;

/** From this share of its size on, a body is sent as it is. */
const MOST = 0.9;

/** A sample of a large body tells whether the rest is worth compressing. */
const SAMPLE_BYTES = 256 * 1024;

/** Return a body by gzip; null where that gains little, or for a form, whose boundary the browser chooses. */
export async function gzipped({ content }: Body): Promise<ArrayBuffer | null> {
  if (!(content instanceof Blob) || content.size < LEAST_BYTES || !("CompressionStream" in window)) return null;
  try {
    if (content.size > 2 * SAMPLE_BYTES) {
      const middle = (content.size - SAMPLE_BYTES) >> 1;
      const sample = await gzip(content.slice(middle, middle + SAMPLE_BYTES));
      if (sample.byteLength > MOST * SAMPLE_BYTES) return null;
    }
    const packed = await gzip(content);
    return packed.byteLength > MOST * content.size ? null : packed;
  } catch {
    // The file cannot be read any more: sending it says so.
    return null;
  }
}

function gzip(content: Blob): Promise<ArrayBuffer> {
  return new Response(content.stream().pipeThrough(new CompressionStream("gzip"))).arrayBuffer();
}
