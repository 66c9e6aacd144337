// Files that the server makes.

import {getBlob, type ApiError} from "./api.js";
import {el, notice} from "./dom.js";

const kKeepMs = 60_000;  // browsers begin to save within

// A link to a file of the name in `download`. A click fetches it, as a browser that follows the link
// would save a refusal as if it were the file. Browsers keep large blobs on disk.
export function downloadLink(text: string): HTMLAnchorElement {
  let busy = false;
  const save = async (path: string, name: string): Promise<void> => {
    if (busy) return;
    busy = true;
    link.textContent = `${text}: waiting`;
    notice("");
    try {
      const url = URL.createObjectURL(await getBlob(path));
      el("a", {href: url, download: name}).click();
      window.setTimeout(() => URL.revokeObjectURL(url), kKeepMs);
    } catch (error) {
      notice((error as ApiError).message);
    } finally {
      busy = false;
      link.textContent = text;
    }
  };
  const link = el("a", {class: "button", click: (event) => {
    event.preventDefault();
    void save(link.href, link.download);
  }}, text);
  return link;
}
