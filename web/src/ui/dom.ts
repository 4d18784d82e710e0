/** The elements of index.html, by id. */

export function element<T extends HTMLElement = HTMLElement>(id: string): T {
  const there = document.getElementById(id);
  if (!there) throw new Error(`index.html has no element #${id}`);
  return there as T;
}

export const input = (id: string): HTMLInputElement => element<HTMLInputElement>(id);
export const select = (id: string): HTMLSelectElement => element<HTMLSelectElement>(id);

/** A new element with text and children inside. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Partial<HTMLElementTagNameMap[K]> = {},
  ...inside: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...inside);
  return made;
}

export function option(value: string, text: string, disabled = false): HTMLOptionElement {
  return make("option", { value, textContent: text, disabled });
}

/** Offer bytes as a file. */
export function save(content: Blob, name: string): void {
  const url = URL.createObjectURL(content);
  make("a", { href: url, download: name }).click();
  // The download reads it after this turn.
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** The function, once no call has come for a while; `cancel` takes back the calls that wait. */
export function debounced(wait: number, act: () => void): { (): void; cancel(): void } {
  let timer = 0;
  const cancel = (): void => clearTimeout(timer);
  const call = (): void => {
    cancel();
    timer = window.setTimeout(act, wait);
  };
  return Object.assign(call, { cancel });
}
