#ifndef LITAGS_CLIENT_REPORT_STYLE_H_
#define LITAGS_CLIENT_REPORT_STYLE_H_

namespace litags::report {

// Light and dark as the reader's system is; on paper always light. Colours of text have a contrast
// of 4.5 or more (WCAG AA) to both grounds.
constexpr char kStyle[] = R"css(
:root { color-scheme: light dark; --ground: #fff; --raised: #f4f5f7; --line: #d3d8de; --text: #1b2026;
  --quiet: #57606b; --light: #8a5a00; --curve: #b36f00; --good: #1c7041; --bad: #b3261e; }
@media (prefers-color-scheme: dark) { :root { --ground: #101317; --raised: #191e25; --line: #39424e;
  --text: #e6e9ed; --quiet: #a9b3bf; --light: #ffd27a; --curve: #ffd27a; --good: #7fd6a0; --bad: #ff9d93; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 66rem; padding: 1.2rem; background: var(--ground); color: var(--text);
  font: 16px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; margin: 0; line-height: 1.25; }
h2 { font-size: 1.15rem; margin: 0 0 .6rem; }
section { margin: 2rem 0 0; break-inside: avoid-page; }
p { margin: .4rem 0; }
.quiet, figcaption, dt { color: var(--quiet); font-size: .875rem; }
.head { display: flex; flex-wrap: wrap; gap: .4rem 1rem; align-items: center; }
.state { border: 1px solid currentColor; border-radius: 1rem; padding: .05rem .6rem; font-size: .875rem; }
.succeeded { color: var(--good); }
.failed, .error { color: var(--bad); }
dl { display: grid; gap: .6rem 1.5rem; margin: 0 0 1rem;
  grid-template-columns: repeat(auto-fill, minmax(min(13rem, 100%), 1fr)); }
dd { margin: 0; }
.facts { grid-template-columns: repeat(auto-fill, minmax(min(8rem, 100%), 1fr)); background: var(--raised); border-radius: .6rem; padding: 1rem; margin: 1.2rem 0 0; }
.facts dd { font-size: 1.25rem; font-weight: 600; }
figure { margin: 0 0 1rem; break-inside: avoid; }
.pair { display: grid; gap: .25rem .6rem; grid-template-columns: repeat(2, 1fr); }
.pair figcaption { grid-column: 1 / -1; }
.pair img { width: 100%; height: auto; display: block; border-radius: .3rem; background: #0a0c0f; }
.pair p { margin: 0; font-size: .875rem; color: var(--quiet); }
.charts { display: grid; gap: 1rem 2rem; grid-template-columns: repeat(auto-fit, minmax(min(24rem, 100%), 1fr)); }
svg { width: 100%; height: auto; display: block; }
.chart { max-width: 34rem; }
svg text { font-size: 12px; fill: var(--quiet); }
svg .name, svg .value { font-size: 13px; fill: var(--text); }
svg .value { font-weight: 600; }
.end { text-anchor: end; }
.mid { text-anchor: middle; }
.grid { stroke: var(--line); fill: none; }
.curve { fill: none; stroke: var(--curve); stroke-width: 2; stroke-linejoin: round; }
.last, .plan circle { fill: var(--curve); }
.sight { stroke: var(--curve); stroke-width: 1.2; opacity: .6; }
.beside { display: flex; flex-wrap: wrap; gap: 1rem 2rem; }
.beside div:first-child { flex: 1 1 20rem; min-width: 0; }
.plan { flex: 0 1 20rem; }
.plan svg { background: var(--raised); border-radius: .6rem; }
table { border-collapse: collapse; width: 100%; font-size: .9375rem; }
th, td { text-align: left; vertical-align: top; padding: .3rem .8rem .3rem 0; border-bottom: 1px solid var(--line);
  font-weight: 400; }
thead th { color: var(--quiet); font-size: .875rem; }
.changed th, .changed td:nth-child(2) { font-weight: 700; color: var(--light); }
.settings th, .settings td { white-space: nowrap; }
.settings .help { white-space: normal; width: 50%; }
.help { color: var(--quiet); font-size: .875rem; }
.stages td { white-space: nowrap; }
.stages td:last-child { width: 55%; padding-right: 0; }
.bar { height: .8rem; min-width: 2px; border-radius: .2rem; background: var(--curve); margin-top: .35rem;
  print-color-adjust: exact; -webkit-print-color-adjust: exact; }
pre { background: var(--raised); border-radius: .4rem; padding: .6rem .8rem; margin: .6rem 0; white-space: pre-wrap;
  font: .875rem/1.5 ui-monospace, "DejaVu Sans Mono", monospace; }
@media (max-width: 40rem) {
  body { padding: .8rem; }
  .pair { grid-template-columns: 1fr; }
  .settings .help { display: none; }
  .settings th, .settings td { white-space: normal; }
}
@media print {
  :root { color-scheme: light; --ground: #fff; --raised: #f4f5f7; --line: #d3d8de; --text: #000; --quiet: #444;
    --light: #6b4600; --curve: #b36f00; --good: #145c33; --bad: #9c1f18; }
  body { max-width: none; padding: 0; font-size: 10pt; }
  .pair, .charts { grid-template-columns: repeat(2, 1fr); }
}
)css";

}  // namespace litags::report

#endif  // LITAGS_CLIENT_REPORT_STYLE_H_
