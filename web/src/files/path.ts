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
