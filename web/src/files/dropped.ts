/** The files of a drop or a paste, folders opened. */

import type { PathedFile } from "./upload";

export async function dropped(transfer: DataTransfer): Promise<PathedFile[]> {
  // The list empties once the event is over, so the entries are taken before the first await.
  const items = [...transfer.items].filter((item) => item.kind === "file");
  const entries = items.map((item) => item.webkitGetAsEntry?.() ?? null);
  if (entries.some((entry) => entry?.isDirectory)) {
    return (await Promise.all(entries.map((entry) => (entry ? opened(entry) : [])))).flat();
  }
  return chosen(transfer.files);
}

export function chosen(files: FileList): PathedFile[] {
  return [...files].map((file) => ({ path: file.webkitRelativePath || file.name, file }));
}

async function opened(entry: FileSystemEntry): Promise<PathedFile[]> {
  const path = entry.fullPath.replace(/^\//, "");
  if (entry.isFile) {
    const file = await new Promise<File>((resolve, reject) =>
      (entry as FileSystemFileEntry).file(resolve, reject),
    );
    return [{ path, file }];
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  const files: PathedFile[] = [];
  // A reader hands out a folder in batches, the last one empty.
  for (;;) {
    const batch = await new Promise<FileSystemEntry[]>((resolve, reject) =>
      reader.readEntries(resolve, reject),
    );
    if (!batch.length) return files;
    for (const inside of batch) files.push(...(await opened(inside)));
  }
}
