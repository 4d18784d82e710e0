/** Paths of files, as documents and archives name them. */

/** The path that a relative address names, in its shortest form. */
export function pathOf(address: string): string {
  let path = address;
  try {
    path = decodeURIComponent(address);
  } catch {
    // A name with a per cent sign of its own.
  }
  return shortest(path);
}

/** A path in its shortest form: a `\` is a `/`, as on Windows, and accents are composed, as macOS leaves them apart. */
export function shortest(path: string): string {
  const steps: string[] = [];
  for (const step of path.normalize("NFC").replaceAll("\\", "/").split("/")) {
    if (step === ".." && (steps.at(-1) ?? "..") !== "..") steps.pop();
    else if (step !== "" && step !== ".") steps.push(step);
  }
  return steps.join("/");
}

/** Find where a name in a file leads: as it stands from each of some folders, else by its base name there, as the
 * paths of other machines do. */
export function leadsTo(name: string, folders: string[], has: (path: string) => boolean): string | undefined {
  const path = name.trim().replace(/^"(.*)"$/, "$1").replaceAll("\\", "/");
  const names = [path, path.slice(path.lastIndexOf("/") + 1)].slice(/^([A-Za-z]:|\/)/.test(path) ? 1 : 0);
  return names.flatMap((way) => folders.map((folder) => shortest(`${folder}/${way}`))).find(has);
}

/** Find the files of an OBJ's `mtllib`: one whose name may have blanks, or several. */
export function libraryPaths(names: string, has: (path: string) => boolean): string[] {
  const whole = leadsTo(names, [""], has);
  return whole === undefined ? names.split(/\s+/).flatMap((name) => leadsTo(name, [""], has) ?? []) : [whole];
}

/** The folder of a path. */
export function folderOf(path: string): string {
  return path.slice(0, Math.max(path.lastIndexOf("/"), 0));
}
