/** Text files, whatever their encoding and line ends. */

/** Return a file's text; lines end with \n. */
export function textOf(bytes: ArrayBuffer): string {
  const [first = 0, second = 0] = new Uint8Array(bytes, 0, Math.min(2, bytes.byteLength));
  const isWide = (first === 0xff && second === 0xfe) || (first !== 0 && second === 0);
  const isTurned = (first === 0xfe && second === 0xff) || (first === 0 && second !== 0);
  const name = isWide ? "utf-16le" : isTurned ? "utf-16be" : "utf-8";
  return new TextDecoder(name).decode(bytes).replace(/\r\n?/g, "\n");
}
