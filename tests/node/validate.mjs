// Khronos's validator over files: prints one JSON object, path -> messages of the severities 0 (error) and 1 (warning).
import { readFile } from "node:fs/promises";
import { validateBytes } from "gltf-validator";

const result = {};
for (const path of process.argv.slice(2)) {
  const report = await validateBytes(new Uint8Array(await readFile(path)), { maxIssues: 0 });
  result[path] = report.issues.messages.filter((message) => message.severity <= 1);
}
console.log(JSON.stringify(result));
