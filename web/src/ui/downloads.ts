/** Downloads of a result: the mesh in a format of the user's choice, its report, and a picture. */

import type { Upload } from "../files/upload";
import type { Result } from "../result";
import type { Session } from "../session";
import type { Compression, Format, Writing } from "../settings";
import { element, input, option, save, select } from "./dom";
import type { Stage } from "./stage";

const MEDIA_TYPES: Record<Format, string> = {
  glb: "model/gltf-binary",
  obj: "model/obj",
  ply: "model/ply",
  stl: "model/stl",
  off: "model/off",
  "3mf": "model/3mf",
};

const FORMATS = Object.keys(MEDIA_TYPES) as Format[];

export function bindDownloads(session: Session, stage: Stage): void {
  select("format").replaceChildren(...FORMATS.map((format) => option(format, format.toUpperCase())));
  select("format").addEventListener("change", adjust);
  element("download").addEventListener("click", () => {
    if (session.ours) void downloadMesh(session, session.ours, writing());
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

/** Choose the format that a file came in; glTF and archives come back as GLB. */
export function offerFormatOf({ kind }: Upload): void {
  select("format").value = FORMATS.find((format) => format === kind) ?? "glb";
  adjust();
}

/** Close what only a glTF can hold. */
function adjust(): void {
  const isGltf = select("format").value === "glb";
  select("compress").disabled = input("attributes").disabled = !isGltf;
}

function writing(): Writing {
  const format = select("format").value as Format;
  if (format !== "glb") return { format };
  return {
    format,
    diagnostics: input("attributes").checked ? "full" : "summary",
    compress: select("compress").value as Compression,
  };
}

/** Save a result as it was when asked for: another file or other settings may be shown before it is there. */
async function downloadMesh(session: Session, ours: Result, wanted: Writing): Promise<void> {
  const { format = "glb", diagnostics, compress } = wanted;
  let content = ours.bytes;
  if (format !== "glb" || diagnostics === "full" || compress !== "none") {
    const again = (): void => void downloadMesh(session, ours, wanted);
    const answer = await session.fetch(ours, wanted, again);
    if (!answer) return;
    content = answer;
  }
  save(new Blob([content], { type: MEDIA_TYPES[format] }), resultName(ours.upload, format));
}

function resultName(upload: Upload, extension: string): string {
  return `${upload.name.replace(/\.\w+$/, "")}-refined.${extension}`;
}
