/** A real server on a free port: `pns serve` with settings of its own. */

import { spawn } from "node:child_process";
import { existsSync } from "node:fs";
import { readFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";

const root = fileURLToPath(new URL("../../..", import.meta.url));
export const PNS = process.env.PNS ?? `${root}/.venv/bin/pns`;

export async function serve(settings = {}) {
  if (!existsSync(PNS)) throw new Error(`${PNS} is not there: make .venv, or set PNS`);
  const env = { ...process.env, OMP_NUM_THREADS: "1", PNS_WORKERS: "1", ...settings };
  const child = spawn(PNS, ["serve", "--port", "0"], { cwd: root, env });
  let log = "";
  const address = await new Promise((resolve, reject) => {
    const read = (piece) => {
      log += piece;
      const line = /running on (http:\/\/[\d.]+:\d+)/.exec(log);
      if (line) resolve(line[1]);
    };
    child.stderr.on("data", read);
    child.stdout.on("data", read);
    child.on("exit", () => reject(new Error(`the server ended:\n${log}`)));
  });
  return {
    address,
    log: () => log,
    /** Wait until a worker has loaded its model. */
    async ready() {
      while (!(await fetch(`${address}/readyz`)).ok) {
        await new Promise((resolve) => setTimeout(resolve, 100));
      }
    },
    /** A worker's first refinement loads the networks: not what a picture or a figure should wait for. */
    async warm() {
      await this.ready();
      for (const scheme of ["pns", "loop"]) {
        const answer = await fetch(`${address}/subdivide?levels=2&scheme=${scheme}`, {
          method: "POST",
          headers: { "Content-Type": "model/gltf-binary" },
          body: await readFile(new URL("../part.glb", import.meta.url)),
        });
        await answer.arrayBuffer();
      }
    },
    /** Wait until a number of the service's own has a value; it shows them, a second late, with PNS_METRICS_PORT. */
    async reaches(name, value) {
      const [, metrics] = /metrics on (http:[^"\s]+)/.exec(log);
      const wanted = new RegExp(`^${name} ${value}(\\.0)?$`, "m");
      while (!wanted.test(await (await fetch(metrics)).text())) {
        await new Promise((resolve) => setTimeout(resolve, 100));
      }
    },
    /** As a machine that loses its power. */
    async kill() {
      const ended = new Promise((resolve) => child.on("exit", resolve));
      child.kill("SIGKILL");
      await ended;
    },
    async close() {
      if (child.signalCode) return;
      const ended = new Promise((resolve) => child.on("exit", resolve));
      child.kill("SIGTERM");
      // The second ends what is under way.
      setTimeout(() => child.kill("SIGTERM"), 500).unref();
      await ended;
    },
  };
}
