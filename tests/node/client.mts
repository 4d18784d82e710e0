// A client of the service as a program would write it, checked against the generated types: every
// path, parameter and body below is one that the description has.
import { readFile, writeFile } from "node:fs/promises";
import createClient from "openapi-fetch";
import type { components, paths } from "./openapi.d.ts";

const [address, input, output] = process.argv.slice(2);
const client = createClient<paths>({ baseUrl: address });
const mesh = new Blob([await readFile(input)], { type: "model/gltf-binary" });

function form(): FormData {
  const body = new FormData();
  body.append("file", mesh, "mesh.glb");
  return body;
}

const asForm = { file: "" };
const refined = await client.POST("/subdivide", {
  params: { query: { levels: 2, scheme: "loop" } },
  body: asForm,
  bodySerializer: form,
  parseAs: "arrayBuffer",
});
if (refined.error) throw new Error(refined.error.detail);
await writeFile(output, new Uint8Array(refined.data as unknown as ArrayBuffer));

const report = await client.POST("/report", {
  params: { query: { scheme: "loop" } },
  body: asForm,
  bodySerializer: form,
});
if (report.error) throw new Error(report.error.detail);

const refused = await client.POST("/subdivide", {
  params: { query: { levels: 7 } },
  body: asForm,
  bodySerializer: form,
});
const problem: components["schemas"]["Problem"] | undefined = refused.error;

const limits = await client.GET("/limits");
const models = await client.GET("/models");

console.log(
  JSON.stringify({
    scheme: report.data.scheme,
    problem: problem?.code,
    body_bytes: limits.data?.body_bytes,
    models: models.data?.map((model) => model.name),
  }),
);
