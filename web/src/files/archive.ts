/** A .zip opened in the page: one .gltf or .glb, and the files that it names. */

import { unzip as inflate, type Unzipped } from "three/addons/libs/fflate.module.js";
import { uploadOf, type Upload } from "./upload";

export async function unzip(upload: Upload): Promise<Upload> {
  const data = new Uint8Array(await upload.file.arrayBuffer());
  const entries = await new Promise<Unzipped>((resolve, reject) =>
    inflate(data, (error, files) => (error ? reject(error) : resolve(files))),
  );
  return uploadOf(
    Object.entries(entries)
      .filter(([path]) => !path.endsWith("/") && /\.(?!zip$)\w+$/i.test(path))
      .map(([path, content]) => ({
        path,
        file: new File([content as BlobPart], path.slice(path.lastIndexOf("/") + 1)),
      })),
  );
}
