/** A loading manager that knows the files at hand and no others. */

import { LoadingManager } from "three";

export interface Local {
  manager: LoadingManager;
  /** Give the addresses back, once all is loaded. */
  release(): void;
}

/** `find` returns the file at an address; `missing` gets the addresses that have none. */
export function localFiles(find: (url: string) => Blob | undefined, missing: Set<string>): Local {
  const made: string[] = [];
  const blobUrl = (blob: Blob): string => {
    const url = URL.createObjectURL(blob);
    made.push(url);
    return url;
  };
  const manager = new LoadingManager();
  manager.setURLModifier((url) => {
    if (url.startsWith("blob:")) return url;
    // The content security policy lets blobs be fetched and nothing else.
    if (url.startsWith("data:")) return blobUrl(blobOfDataUri(url));
    const file = find(url);
    if (file) return blobUrl(file);
    missing.add(url);
    return blobUrl(new Blob());
  });
  return { manager, release: () => made.forEach((url) => URL.revokeObjectURL(url)) };
}

function blobOfDataUri(uri: string): Blob {
  const comma = uri.indexOf(",");
  const head = uri.slice(5, comma);
  const type = head.replace(/;base64$/, "");
  const text = decodeURIComponent(uri.slice(comma + 1));
  if (!head.endsWith(";base64")) return new Blob([text], { type });
  return new Blob([Uint8Array.from(atob(text), (character) => character.charCodeAt(0))], { type });
}
