/** The page: what the user does goes to the session, what comes of it to the stage and the panel. */

import { certify, describe } from "./account";
import { json, request, type Limits, type ModelEntry } from "./api/client";
import { fileProblem } from "./api/problem";
import type { Opened } from "./files/open";
import { uploadsOf, type Dropped, type PathedFile, type Upload } from "./files/upload";
import { bytes, listed } from "./report/format";
import { Session, type Again, type Result } from "./session";
import { DEFAULTS, fromHash, toHash, type Asked, type Settings } from "./settings";
import { debounced, element } from "./ui/dom";
import { bindDownloads } from "./ui/downloads";
import { bindFiles } from "./ui/file-input";
import { FileList } from "./ui/file-list";
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
import { dispose, type Model } from "./view/model";

/** Another try at what failed last. */
let retry: Again = () => {};
/** Files that are chosen count up: the last of them counts, however long the others take to come. */
let choices = 0;
/** The result whose values at vertices are on their way. */
let awaiting: Result | null = null;

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
    document.body.classList.add("refined");
    if (session.source) describe(ours, session.source, stage);
  },
  compared: (loop) => {
    const { ours } = session;
    if (!ours) return;
    stage.refine(ours, loop);
    announce(`Refined. ${certify(ours, loop, stage)}`);
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
  const takeExample = (): void => void take(example(), takeExample);
  element("example").addEventListener("click", takeExample);
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

bindFiles((files) => void take(files));
bindPanel();
bindDownloads(session, stage);
let offered = start();
