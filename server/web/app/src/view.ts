// What a page of the app is.

export interface View {
  title: string;
  element: HTMLElement;
  // Whether it has what would be lost: it is put back once a token was entered.
  keeps?: () => boolean;
  // What the user is asked before another page takes its place, as leaving would end something; or nothing.
  asks?: () => string;
  // Called when another page takes its place: timers, streams and listeners end.
  leave?: () => void;
}

// Calls `step` now and every so many seconds, never twice at a time, while the page is seen.
export function every(seconds: number, step: () => Promise<void>): () => void {
  let timer = 0, stopped = false;
  const run = async (): Promise<void> => {
    if (!document.hidden) await step().catch(() => {});
    if (!stopped) timer = window.setTimeout(run, 1000 * seconds);
  };
  void run();
  return () => { stopped = true; window.clearTimeout(timer); };
}
