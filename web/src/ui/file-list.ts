/** The name of the file that is shown; where several came together, a list to choose from. */

import type { Upload } from "../files/upload";
import { element, option, select } from "./dom";

const UNTITLED = document.title;

export class FileList {
  private dropped: Upload[] = [];
  private shown: Upload | null = null;

  constructor(chosen: (upload: Upload) => void) {
    select("file").addEventListener("change", () => {
      const upload = this.listed[Number(select("file").value)];
      if (upload) chosen(upload);
    });
  }

  /** Offer the files of a drop; the first is on its way. */
  offer(uploads: Upload[]): void {
    this.dropped = uploads;
    this.write(uploads[0] ?? null);
  }

  /** Name the file on the stage; null where there is none. `coming`: another that is chosen. */
  show(upload: Upload | null, coming: Upload | null = null): void {
    this.shown = upload;
    this.write(coming ?? upload);
  }

  /** All that may be chosen: what is shown may have come before the others. */
  private get listed(): Upload[] {
    const { dropped, shown } = this;
    if (dropped.length < 2) return [];
    return shown && !dropped.includes(shown) ? [shown, ...dropped] : dropped;
  }

  private write(chosen: Upload | null): void {
    const { listed, shown } = this;
    element("file-name").textContent = shown?.name ?? "";
    // Tabs are told apart by it.
    document.title = shown ? `${shown.name} – PNS` : UNTITLED;
    element("file-name").hidden = listed.length > 0;
    select("file").hidden = !listed.length;
    select("file").replaceChildren(
      ...listed.map(({ path }, number) => option(String(number), `${path} (${number + 1} of ${listed.length})`)),
    );
    // Where none is chosen each can be.
    select("file").selectedIndex = chosen ? listed.indexOf(chosen) : -1;
  }
}
