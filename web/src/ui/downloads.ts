/** What is downloaded of a result: its GLB, its report, and a picture. */

import type { Upload } from "../files/upload";
import type { Result, Session } from "../session";
import type { Compression, Diagnostics } from "../settings";
import { element, input, save, select } from "./dom";
import type { Stage } from "./stage";

export function bindDownloads(session: Session, stage: Stage): void {
  element("download").addEventListener("click", () => {
    const diagnostics = input("attributes").checked ? "full" : "summary";
    if (session.ours) void downloadGlb(session, session.ours, diagnostics, select("compress").value as Compression);
  });
  element("download-report").addEventListener("click", () => {
    if (!session.ours) return;
    const { upload, report } = session.ours;
    save(new Blob([JSON.stringify(report, null, 2)], { type: "application/json" }), resultName(upload, "json"));
  });
  element("download-picture").addEventListener("click", async () => {
    const upload = session.source?.upload;
    if (stage.viewer && upload) save(await stage.viewer.picture(), resultName(upload, "png"));
  });
  input("download-picture").disabled = !stage.viewer;
}

/** What is downloaded is chosen now: another file may be there, or other settings, before the answer is. */
async function downloadGlb(
  session: Session,
  ours: Result,
  diagnostics: Diagnostics,
  compress: Compression,
): Promise<void> {
  let content = ours.bytes;
  if (diagnostics === "full" || compress !== "none") {
    const again = () => void downloadGlb(session, ours, diagnostics, compress);
    const answer = await session.fetch(ours, diagnostics, compress, again);
    if (!answer) return;
    content = answer;
  }
  save(new Blob([content], { type: "model/gltf-binary" }), resultName(ours.upload, "glb"));
}

function resultName(upload: Upload, extension: string): string {
  return `${upload.name.replace(/\.\w+$/, "")}-refined.${extension}`;
}
