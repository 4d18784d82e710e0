/** The page: what the user does goes to the session, what comes of it to the stage and the panel. */

import { certify, describe } from "./account";
import { json, request, type Limits, type ModelEntry } from "./api/client";
import { fileProblem } from "./api/problem";
import type { Opened } from "./files/open";
import { uploadsOf, type Dropped, type PathedFile, type Upload } from "./files/upload";
import { bytes, listed } from "./report/format";
import type { Result } from "./result";
import { isTheFiles, Session } from "./session";
import { DEFAULTS, fromHash, toHash, type Asked, type Settings } from "./settings";
import type { Again } from "./tasks";
import { debounced, element, input } from "./ui/dom";
import { bindDownloads, offerFormatOf } from "./ui/downloads";
import { bindFiles } from "./ui/file-input";
import { FileList } from "./ui/file-list";
import { bindPanel, keepFocus } from "./ui/panel";
import { SettingsForm } from "./ui/settings-form";
import { Stage } from "./ui/stage";
import { addNotice, announce, hideNotice, hideProblem, hideProgress, showNotice, showProblem, showProgress } from "./ui/status";
import { dispose, type Model } from "./view/model";

const nothing: Again = () => {};
/** Another try at what failed last, and at what was cancelled last. */
let [retry, resume] = [nothing, nothing];
/** Each choice of files gets a number: only the last one counts, however long the others take to arrive. */
let choices = 0;
/** The result whose values at vertices are on their way. */
let awaiting: Result | null = null;
/** The example that the page shows of itself. */
let example: Upload | null = null;

const stage = new Stage(() => void fetchValues(), remember);

const session = new Session({
  progress: (progress, what) => {
    // The user has uploaded nothing yet.
    const isSilent = session.source?.upload === example && ["upload", "queue"].includes(progress.step);
    showProgress(isSilent ? { step: "refine", share: null } : progress, what);
  },
  opened: (source) => {
    const { upload, opened } = source;
    document.body.classList.remove("empty", "refined");
    document.body.classList.toggle("example", upload === example);
    element("advice").hidden = true;
    form.rigged = source.model.meshes.some((mesh) => "isSkinnedMesh" in mesh);
    form.fit(opened);
    fileList.show(upload);
    offerFormatOf(upload);
    stage.open(source);
    remember();
    if (opened.missing.length) addNotice(`${upload.name} names what is not among the files: ${listed(opened.missing)}.`);
  },
  refined: (ours) => {
    stage.refine(ours, session.loop);
    document.body.classList.add("refined");
    if (session.source) describe(ours, session.source, stage, (deed) => restore({ ...form.asked.wanted, ...deed }));
  },
  compared: (loop) => {
    const { ours, source } = session;
    if (!ours || !source) return;
    stage.refine(ours, loop);
    announce(`Done. ${certify(ours, source, loop, stage)}`);
  },
  stayed: (ours) => {
    changed.cancel();
    form.show(ours.asked, session.source?.opened);
    remember();
  },
  renewed: (asked) => {
    changed.cancel();
    form.show(asked, session.source?.opened);
    remember();
  },
  stopped: ({ name }, again) => {
    resume = again;
    fileList.show(session.source?.upload ?? null);
    showNotice(`${name}: cancelled`, true);
  },
  idle: hideProgress,
  failed: (error, { upload, again }) => {
    retry = again;
    fileList.show(session.source?.upload ?? null);
    // Nobody asked for the example.
    if (upload && upload === example && !isTheFiles(error)) return session.leave();
    showProblem(error, isTheFiles(error) ? upload?.name : "");
  },
  cleared: () => {
    document.body.classList.remove("refined", "example");
    document.body.classList.add("empty");
    fileList.show(null);
    form.fit();
    stage.arrange();
  },
  discarded: (model) => stage.discard(model),
});

const given = fromHash(location.hash);
const changed = debounced(300, () => {
  remember();
  clear();
  void session.again(form.asked);
});
const form = new SettingsForm(given.settings, changed);
pinFromLink(given.settings);
stage.view = given.view;
const fileList = new FileList(takeOne);

/** Return what is asked for a file that was just opened. */
async function prepare(upload: Upload, opened: Opened, signal: AbortSignal): Promise<Asked> {
  // Which levels are open depends on the service's limits.
  await offered;
  signal.throwIfAborted();
  const before = form.asked;
  // What was set for another file stays with it, unless it is pinned.
  const isOther = session.source !== null && session.source.upload !== upload;
  if (isOther && !input("pin").checked) form.want(DEFAULTS);
  form.fit(opened);
  const { refused, asked } = form;
  if (!refused) return asked;
  form.show(before, session.source?.opened);
  throw fileProblem("The mesh is too large", `${upload.name} would have ${refused}.`);
}

/** Take the files of a drop or a choice; `again` is another try where they do not arrive. */
async function take(files: PathedFile[] | Promise<PathedFile[]>, again = nothing): Promise<void> {
  clear();
  const choice = ++choices;
  showProgress({ step: "open", share: null });
  try {
    const dropped = await uploadsOf(await files);
    if (choice !== choices) return;
    fileList.offer(dropped.uploads);
    const isTaken = takeOne(dropped.uploads[0]!);
    const others = describeOthers(dropped, isTaken);
    if (others) showNotice(others);
  } catch (error) {
    if (choice !== choices) return;
    if (!session.isBusy) hideProgress();
    retry = again;
    showProblem(error);
  }
}

/** Open and refine a file; returns false for one that is too large to be sent. */
function takeOne(upload: Upload): boolean {
  clear();
  choices++;
  const most = form.largestUpload;
  if (upload.bytes <= most) {
    void session.take(upload, prepare);
    return true;
  }
  if (!session.isBusy) hideProgress();
  const detail = `${upload.name} has ${bytes(upload.bytes)}; this service takes up to ${bytes(most)}.`;
  showProblem(fileProblem("The file is too large", detail));
  fileList.show(session.source?.upload ?? null);
  return false;
}

/** Say what came beside the first file; empty where nothing did. */
function describeOthers({ uploads: [first, ...others], unused }: Dropped, isOpened: boolean): string {
  const names = listed(others.map(({ path }) => path));
  const rest = isOpened ? `${first?.path} is opened; the list at the top has ${names} too.` : `The list at the top has ${names}.`;
  const sentences = [
    others.length ? rest : "",
    unused.length ? `Not used: ${listed(unused)}.` : "",
  ];
  return sentences.filter(Boolean).join(" ");
}

/** Take back what was said of the last try. */
function clear(): void {
  hideProblem();
  hideNotice();
  [retry, resume] = [nothing, nothing];
}

/** Put other settings in the form's place. */
function restore(wanted: Settings): void {
  changed.cancel();
  form.want(wanted);
  remember();
  clear();
  void session.again(form.asked);
}

/** Fetch the values at vertices, which a plain result does not hold. */
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

/** Settings that a link names are for any file. */
function pinFromLink(settings: Settings): void {
  input("pin").checked = toHash(settings, {}) !== "";
}

/** Put what the user wants into the address: not what one file makes of it. */
function remember(): void {
  const hash = toHash(form.asked.wanted, stage.view);
  history.replaceState(null, "", hash ? `#${hash}` : location.pathname + location.search);
}

async function exampleFile(): Promise<PathedFile[]> {
  const response = await request(`assets/${EXAMPLE}`);
  const file = new File([await response.arrayBuffer()], "example.glb");
  return [{ path: file.name, file }];
}

/** Show the example of the page's own accord: quietly, and not to users who save data. */
async function showLiveExample(): Promise<void> {
  if ((navigator as { connection?: { saveData?: boolean } }).connection?.saveData) return;
  const choice = choices;
  try {
    const { uploads } = await uploadsOf(await exampleFile());
    if (choice !== choices) return;
    example = uploads[0]!;
    takeOne(example);
  } catch {
    // The welcome stays, with a button that says what is wrong.
  }
}

/** Ask what the service offers; the page works with less where it does not answer. */
async function start(): Promise<void> {
  void json<ModelEntry[]>("models")
    .then((models) => form.offerModels(models))
    .catch(showProblem);
  await json<Limits>("limits")
    .then((limits) => {
      form.offerLimits(limits);
      element("limits").textContent = ` · up to ${bytes(limits.body_bytes)}`;
    })
    .catch(showProblem);
}

bindFiles((files) => void take(files));
bindDownloads(session, stage);
bindPanel({
  cancel: () => {
    choices++;
    session.cancel();
    if (!element("notice").hidden) element("again").focus();
  },
  reset: () => {
    input("pin").checked = false;
    restore({ ...DEFAULTS });
  },
  retry: () => {
    offered = start();
    retry();
  },
  resume: () => resume(),
  showExample: function showExample() {
    void take(exampleFile(), showExample);
  },
  remember,
});
keepFocus();
// A link that is followed in the page's own tab changes nothing but the part after #.
addEventListener("hashchange", () => {
  const { settings, view } = fromHash(location.hash);
  stage.view = view;
  pinFromLink(settings);
  restore(settings);
});
let offered = start();
void showLiveExample();
