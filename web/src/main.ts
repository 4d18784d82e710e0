/** The page: what the user does goes to the session, what comes of it to the stage and the panel. */

import { json, request, type Limits, type ModelEntry } from "./api/client";
import { fileProblem, isAbort } from "./api/problem";
import { chosen, dropped } from "./files/dropped";
import type { Opened } from "./files/open";
import { uploadsOf, type Dropped, type PathedFile, type Upload } from "./files/upload";
import { dihedrals } from "./measure/dihedral";
import { distances, largestLength, rounding } from "./measure/distance";
import { surfaceOf } from "./measure/surface";
import type { Lengths } from "./report/certificate";
import { bytes, listed } from "./report/format";
import { Session, type Again, type Result, type Source } from "./session";
import { DEFAULTS, fromHash, toHash, type Asked, type Compression, type Diagnostics, type Settings } from "./settings";
import { debounced, element, input, save, select } from "./ui/dom";
import { FileList } from "./ui/file-list";
import {
  showCertificate,
  showChanges,
  showStatistics,
  showTimings,
  showValidation,
  type Before,
} from "./ui/results";
import { SettingsForm } from "./ui/settings-form";
import { Stage } from "./ui/stage";
import {
  addNotice,
  announce,
  bindNotice,
  bindProblem,
  hideNotice,
  hideProblem,
  hideProgress,
  showNotice,
  showProblem,
  showProgress,
} from "./ui/status";
import { compare } from "./validate/compare";
import { validate } from "./validate/validate";
import { dispose, type Model } from "./view/model";

let validation = new AbortController();
/** Another try at what failed last. */
let retry: Again = () => {};
/** Files that are chosen count up: the last of them counts, however long the others take to come. */
let choices = 0;
/** The result whose values at vertices are on their way. */
let awaiting: Result | null = null;
/** Of the file that is shown. */
let facts: { source: Source; before: Before } | null = null;

const stage = new Stage(() => void fetchValues(), remember);

const session = new Session({
  progress: showProgress,
  opened: (source) => {
    document.body.classList.remove("empty", "refined");
    fileList.show(source.upload);
    stage.open(source);
    const { missing } = source.opened;
    if (missing.length) addNotice(`${source.upload.name} names what is not among the files: ${listed(missing)}.`);
  },
  stayed: () => {
    const { source, ours } = session;
    fileList.show(source?.upload ?? null);
    // A setting of what is over.
    changed.cancel();
    if (!source) {
      // What it was fitted to is gone.
      form.fit(null);
      return;
    }
    if (ours) form.show(ours.asked, source.upload, source.opened.faces);
    else form.fit(source);
    remember();
  },
  renewed: (upload, asked) => {
    const { source } = session;
    fileList.show(source?.upload ?? null, upload);
    changed.cancel();
    form.show(asked, upload, source?.upload === upload ? source.opened.faces : 0);
    remember();
  },
  stopped: ({ name }) => showNotice(`${name}: cancelled`, true),
  refined: (ours) => {
    stage.refine(ours, session.loop);
    const milliseconds = performance.now() - ours.began;
    describe(ours);
    showTimings([
      ...ours.timings.map(([name, ms]): [string, number] => [STAGES[name] ?? name, ms / 1000]),
      ["From request to picture", milliseconds / 1000],
    ]);
    void validateBoth(ours);
  },
  compared: (loop) => {
    const { ours } = session;
    if (!ours) return;
    stage.refine(ours, loop);
    announce(`Refined. ${showCertificate(ours.report, lengths(ours, loop))}`);
  },
  idle: hideProgress,
  failed: (error, again, upload) => {
    retry = again;
    showProblem(error, upload?.name);
  },
  cleared: () => {
    document.body.classList.add("empty");
    document.body.classList.remove("refined");
    fileList.show(null);
    form.fit(null);
    stage.arrange();
  },
  discarded: (model) => stage.discard(model),
});

const STAGES: Record<string, string> = {
  read: "Service: reading",
  weld: "Service: welding",
  refine: "Service: refining",
  attributes: "Service: attributes",
  write: "Service: writing",
  upload: "Upload",
  queue: "Queue",
  total: "Service: in all",
  opening: "Opening the result",
};

const given = fromHash(location.hash);
const changed = debounced(300, () => {
  remember();
  clear();
  void session.again(form.asked, prepare);
});
const form = new SettingsForm(given.settings, changed);
stage.view = given.view;
const fileList = new FileList(takeOne);

async function prepare(upload: Upload, opened: Opened, signal: AbortSignal): Promise<Asked> {
  // Which levels are open depends on the service's limits.
  await offered;
  signal.throwIfAborted();
  form.fit({ upload, opened });
  // It would be sent for nothing.
  if (form.refused) throw fileProblem("The mesh is too large", `${upload.name} would have ${form.refused}.`);
  return form.asked;
}

/** `again` is another try where they do not come. */
async function take(files: PathedFile[] | Promise<PathedFile[]>, again: Again = () => {}): Promise<void> {
  clear();
  const choice = ++choices;
  try {
    const dropped = await uploadsOf(await files);
    if (choice !== choices) return;
    fileList.offer(dropped.uploads);
    const isTaken = takeOne(dropped.uploads[0]!);
    const others = tellOthers(dropped, isTaken);
    if (others) showNotice(others);
  } catch (error) {
    if (choice !== choices) return;
    retry = again;
    showProblem(error);
  }
}

/** Whether it is on its way: what is too large is not. */
function takeOne(upload: Upload): boolean {
  clear();
  choices++;
  const most = form.largestUpload;
  if (upload.bytes > most) {
    // It would be sent for nothing.
    const detail = `${upload.name} has ${bytes(upload.bytes)}; this service takes up to ${bytes(most)}.`;
    showProblem(fileProblem("The file is too large", detail));
    fileList.show(session.source?.upload ?? null, session.coming);
    return false;
  }
  void session.take(upload, prepare);
  return true;
}

/** What came beside the first file, which may be opened; empty where nothing did. */
function tellOthers({ uploads: [first, ...others], unused }: Dropped, isOpened: boolean): string {
  const names = listed(others.map(({ path }) => path));
  const rest = isOpened ? `${first?.path} is opened; the list at the top has ${names} too.` : `The list at the top has ${names}.`;
  const sentences = [
    others.length ? rest : "",
    unused.length ? `Not used: ${listed(unused)}.` : "",
  ];
  return sentences.filter(Boolean).join(" ");
}

/** Before something new: what was said of the last is over. */
function clear(): void {
  hideProblem();
  hideNotice();
  retry = () => {};
}

/** Put other settings in the form's place. */
function restore(wanted: Settings): void {
  changed.cancel();
  form.want(wanted);
  if (session.source) form.fit(session.source);
  remember();
  clear();
  void session.again(form.asked, prepare);
}

/** Everything that the report and the file say, before Loop's side has come. */
function describe(ours: Result): void {
  document.body.classList.add("refined");
  const { source } = session;
  if (!source) return;
  showCertificate(ours.report, lengths(ours, null));
  if (facts?.source !== source) facts = { source, before: before(source) };
  const sharpest = (): number => dihedrals(ours.model).max;
  showStatistics(facts.before, ours.report, ours.bytes.byteLength, sharpest);
  showChanges(ours.report);
}

function lengths({ model, report }: Result, loop: Result | null): Lengths {
  const ofMesh = new Map(report.meshes.map((mesh) => [mesh.index, mesh]));
  const measured = loop && distances(model, loop.model);
  return {
    proved: largestLength(model, (index) => ofMesh.get(index)?.limit_distance ?? 0) ?? 0,
    allowed: largestLength(model, (index) => ofMesh.get(index)?.limit_distance_bound),
    measured: measured && measured.max,
    rounding: rounding(model),
    size: stage.size,
    unit: stage.unit,
  };
}

/** What is told of the file itself; it stays the same however often it is refined. */
function before({ upload, opened, model }: Source): Before {
  const geometries = new Set(model.meshes.map(({ geometry }) => geometry));
  const vertices = [...geometries].reduce((n, g) => n + g.getAttribute("position").count, 0);
  return {
    faces: opened.faces,
    vertices,
    bytes: upload.bytes,
    surface: surfaceOf(model.meshes),
    sharpest: dihedrals(model).max,
  };
}

async function validateBoth(ours: Result): Promise<void> {
  validation.abort();
  const { signal } = (validation = new AbortController());
  showValidation("Looking at both files…");
  try {
    const gltf = session.source?.opened.gltf;
    const result = await validate({ bytes: ours.bytes, neighbours: new Map() }, signal);
    const first = gltf ? await validate(gltf, signal) : null;
    showValidation(compare(first, result));
  } catch (error) {
    if (!isAbort(error)) showValidation(`The validator could not run: ${(error as Error).message}`);
  }
}

/** The values at vertices, which a plain result does not hold: the same job with all diagnostics. */
async function fetchValues(): Promise<void> {
  const { ours } = session;
  if (!ours || ours === awaiting) return;
  awaiting = ours;
  const full = await session.full(ours, () => stage.arrange());
  if (awaiting === ours) awaiting = null;
  if (!full) return;
  if (session.ours === ours) adopt(ours, full);
  dispose(full);
}

/** Give a result the values that another has. */
function adopt(ours: Result, full: Model): void {
  full.meshes.forEach(({ geometry }, number) => {
    const target = ours.model.meshes[number]?.geometry;
    for (const name of ["_pns_ratio", "_pns_gate"]) {
      if (geometry.hasAttribute(name)) target?.setAttribute(name, geometry.getAttribute(name));
    }
  });
  ours.full = true;
  stage.arrange();
}

function remember(): void {
  const hash = toHash(form.asked.settings, stage.view);
  history.replaceState(null, "", hash ? `#${hash}` : location.pathname + location.search);
}

function resultName(upload: Upload, extension: string): string {
  return `${upload.name.replace(/\.\w+$/, "")}-refined.${extension}`;
}

/** What is downloaded is chosen now: another file may be there, or other settings, before the answer is. */
async function downloadGlb(ours: Result, diagnostics: Diagnostics, compress: Compression): Promise<void> {
  let content = ours.bytes;
  if (diagnostics === "full" || compress !== "none") {
    const again = () => void downloadGlb(ours, diagnostics, compress);
    const answer = await session.fetch(ours, diagnostics, compress, again);
    if (!answer) return;
    content = answer;
  }
  save(new Blob([content], { type: "model/gltf-binary" }), resultName(ours.upload, "glb"));
}

function bindFiles(): void {
  const files = input("files");
  for (const id of ["choose", "choose-first"]) {
    element(id).addEventListener("click", () => files.click());
  }
  files.addEventListener("change", () => {
    if (files.files?.length) void take(chosen(files.files));
    // The same file may be chosen again.
    files.value = "";
  });
  const takeExample = (): void => void take(example(), takeExample);
  element("example").addEventListener("click", takeExample);
  const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
  document.addEventListener("dragover", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    document.body.classList.add("dragging");
  });
  document.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) document.body.classList.remove("dragging");
  });
  document.addEventListener("drop", (event) => {
    // Words may be dropped into a field.
    if (!event.dataTransfer || !hasFiles(event)) return;
    event.preventDefault();
    document.body.classList.remove("dragging");
    void take(dropped(event.dataTransfer));
  });
  document.addEventListener("paste", (event) => {
    if (event.clipboardData?.files.length) void take(chosen(event.clipboardData.files));
  });
}

async function example(): Promise<PathedFile[]> {
  const response = await request(`assets/${EXAMPLE}`);
  const file = new File([await response.arrayBuffer()], "example.glb");
  return [{ path: file.name, file }];
}

function bindPanel(): void {
  element("cancel").addEventListener("click", () => {
    session.cancel();
    hideProgress();
    // Its own button is gone.
    element(element("notice").hidden ? "panel" : "again").focus();
  });
  bindNotice(() => void session.resume(prepare));
  bindProblem(() => {
    offered = start();
    retry();
  });
  element("reset").addEventListener("click", () => restore({ ...DEFAULTS }));
  // A link that is followed in the page's own tab changes nothing but the part after #.
  addEventListener("hashchange", () => {
    const { settings, view } = fromHash(location.hash);
    stage.view = view;
    restore(settings);
  });
  document.querySelector(".skip")?.addEventListener("click", (event) => {
    // The part after # has the settings.
    event.preventDefault();
    element("panel").focus();
  });
  element("fold").addEventListener("click", () => {
    const folded = document.body.classList.toggle("folded");
    element("fold").setAttribute("aria-expanded", String(!folded));
  });
  element("share").addEventListener("click", async () => {
    remember();
    // Browsers keep the clipboard from pages without TLS; the address bar has the link all the same.
    const copied = await navigator.clipboard?.writeText(location.href).then(
      () => true,
      () => false,
    );
    announce(copied ? "The link is copied" : "The link is in the address bar");
    element("share").textContent = copied ? "Copied" : "See address bar";
    setTimeout(() => (element("share").textContent = "Copy link"), 1500);
  });
  element("download").addEventListener("click", () => {
    const diagnostics = input("attributes").checked ? "full" : "summary";
    if (session.ours) void downloadGlb(session.ours, diagnostics, select("compress").value as Compression);
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

/** What the service offers; the page works with less where it does not say. */
async function start(): Promise<void> {
  const models = json<ModelEntry[]>("models")
    .then((models) => form.offerModels(models))
    .catch(showProblem);
  await json<Limits>("limits")
    .then((limits) => {
      form.offerLimits(limits);
      element("limits").textContent = ` · up to ${bytes(limits.body_bytes)}`;
    })
    .catch(showProblem);
  void models;
}

bindFiles();
bindPanel();
let offered = start();
