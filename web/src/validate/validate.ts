/** Ask the validator's worker; it is fetched when it is first needed. */

import type { Outcome } from "gltf-validator";
import type { Request } from "./worker";

export async function validate(request: Request, signal: AbortSignal): Promise<Outcome> {
  const worker = new Worker(new URL(VALIDATOR, import.meta.url));
  try {
    return await new Promise<Outcome>((resolve, reject) => {
      signal.addEventListener("abort", () => reject(new DOMException("cancelled", "AbortError")));
      worker.onerror = (event) => reject(new Error(event.message || "the validator did not start"));
      worker.onmessage = ({ data }: MessageEvent<{ outcome?: Outcome; failure?: string }>) =>
        data.outcome ? resolve(data.outcome) : reject(new Error(data.failure));
      worker.postMessage(request);
    });
  } finally {
    worker.terminate();
  }
}
