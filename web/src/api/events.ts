/**
 * Server-sent events over fetch: EventSource can carry no Authorization header.
 * Follows the parsing rules of the HTML standard (§9.2.6), without reconnection.
 */

export interface ServerEvent {
  event: string;
  data: string;
}

/** The events of a text/event-stream body, as they come. */
export async function* events(body: AsyncIterable<Uint8Array>): AsyncGenerator<ServerEvent> {
  const decoder = new TextDecoder();
  let pending = "";
  for await (const piece of body) {
    pending += decoder.decode(piece, { stream: true });
    const blocks = pending.split(/\r\n\r\n|\n\n|\r\r/);
    pending = blocks.pop() ?? "";
    for (const block of blocks) {
      const event = parse(block);
      if (event) yield event;
    }
  }
}

function parse(block: string): ServerEvent | null {
  let event = "message";
  const data: string[] = [];
  for (const line of block.split(/\r\n|\n|\r/)) {
    const [, name, value] = /^([^:]*):? ?(.*)$/.exec(line) ?? [];
    if (name === "event" && value) event = value;
    if (name === "data") data.push(value ?? "");
  }
  return data.length ? { event, data: data.join("\n") } : null;
}
