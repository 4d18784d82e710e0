/** The parts of a multipart/mixed body (RFC 2046), as they come. */

export interface Part {
  /** What it is, by its Content-Description. */
  name: string;
  headers: Map<string, string>;
  bytes: ArrayBuffer;
}

/** Thrown where a stream ends before its closing boundary. */
export class Cut extends Error {}

/** The parts of a body; `tell` hears how much of one has come whose length is known. */
export async function* parts(
  body: AsyncGenerator<Uint8Array>,
  type: string,
  tell: (received: number, total: number) => void,
): AsyncGenerator<Part> {
  const boundary = /boundary="?([^";]+)/.exec(type)?.[1];
  if (!boundary) throw new Cut("no boundary");
  const source = new Source(body);
  const delimiter = `\r\n--${boundary}`;
  await source.until(delimiter.slice(2));
  while ((await source.until("\r\n")) !== "--") {
    const head = await source.until("\r\n\r\n");
    const headers = new Map(head.split("\r\n").map((line) => {
      const [name = "", ...value] = line.split(":");
      return [name.toLowerCase(), value.join(":").trim()];
    }));
    const length = Number(headers.get("content-length") ?? NaN);
    let bytes: ArrayBuffer;
    if (Number.isNaN(length)) {
      bytes = new TextEncoder().encode(await source.until(delimiter)).buffer;
    } else {
      bytes = await source.take(length, (received) => tell(received, length));
      await source.until(delimiter);
    }
    yield { name: headers.get("content-description") ?? "", headers, bytes };
  }
}

/** Pieces of bytes, read by what ends them or by their number. */
class Source {
  private held = new Uint8Array();

  constructor(private readonly pieces: AsyncGenerator<Uint8Array>) {}

  /** The text before an end, which is taken too. Small parts alone are read so. */
  async until(end: string): Promise<string> {
    for (;;) {
      const text = new TextDecoder("latin1").decode(this.held);
      const place = text.indexOf(end);
      if (place >= 0) {
        const before = this.held.subarray(0, place);
        this.held = this.held.subarray(place + end.length);
        return new TextDecoder().decode(before);
      }
      await this.more();
    }
  }

  async take(length: number, tell: (received: number) => void): Promise<ArrayBuffer> {
    const taken = new Uint8Array(length);
    let received = 0;
    for (;;) {
      const piece = this.held.subarray(0, length - received);
      taken.set(piece, received);
      received += piece.length;
      this.held = this.held.subarray(piece.length);
      tell(received);
      if (received === length) return taken.buffer;
      await this.more();
    }
  }

  private async more(): Promise<void> {
    const { value, done } = await this.pieces.next();
    if (done) throw new Cut("the stream ends before its closing boundary");
    const joined = new Uint8Array(this.held.length + value.length);
    joined.set(this.held);
    joined.set(value, this.held.length);
    this.held = joined;
  }
}
