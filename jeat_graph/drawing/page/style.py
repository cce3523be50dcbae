"""The page's style sheet: light and dark, from a phone's width upwards."""

CSS = """
:root {
  color-scheme: light dark;
  --paper: #fbfaf7; --card: #ffffff; --ink: #22272e; --quiet: #5b6470; --line: #d9d5cb; --plane: #f1efe9;
  --accent: #00629b; --warn: #8a4b00; --warn-paper: #fff3df; --track-l: 38%; --band: 18%;
  --s0: #0077b6; --s1: #c2185b; --s2: #3f7d05; --s3: #7b2cbf; --s4: #a15c00; --s5: #00796b;
  --now: #c4551b; --late: #0b7a5b;
}
@media (prefers-color-scheme: dark) {
  :root {
    --paper: #0d1117; --card: #151b23; --ink: #d7dde5; --quiet: #98a3b0; --line: #2f3947; --plane: #06080c;
    --accent: #6cc4f5; --warn: #ffc56b; --warn-paper: #2b2110; --track-l: 66%; --band: 26%;
    --s0: #4cc9f0; --s1: #f78fb3; --s2: #9ef01a; --s3: #c77dff; --s4: #ffb454; --s5: #4fd6c0;
    --now: #ff9d66; --late: #5fd3a0;
  }
}
@media (prefers-color-scheme: dark) {
  /* The pictures of `compare` are drawn on white: lightness turned over, hues kept. */
  figure img { filter: invert(.92) hue-rotate(180deg); }
}
* { box-sizing: border-box; }
body {
  margin: 0 auto; padding: 1.2rem clamp(.7rem, 3vw, 2rem) 3rem; max-width: 75rem;
  background: var(--paper); color: var(--ink);
  font: 1rem/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif;
}
h1 { font-size: 1.6rem; line-height: 1.2; margin: .2rem 0 .3rem; overflow-wrap: anywhere; }
h2 { font-size: 1.2rem; margin: 2.2rem 0 .6rem; }
h3 { font-size: 1rem; margin: 1.2rem 0 .4rem; }
p { margin: .4rem 0; max-width: 70ch; }
.quiet { color: var(--quiet); }
.notes {
  margin: 1rem 0; padding: .6rem .9rem; border-left: .3rem solid var(--warn); background: var(--warn-paper);
}
.notes ul { margin: 0; padding-left: 1.1rem; }
.scroll { overflow-x: auto; margin: .6rem 0 1rem; }
.scroll.tall { max-height: 30rem; overflow-y: auto; border: 1px solid var(--line); }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9rem; }
caption { text-align: left; font-weight: 600; padding: .3rem 0; white-space: nowrap; }
th, td {
  padding: .25rem .7rem .25rem 0; text-align: left; white-space: nowrap;
  border-bottom: 1px solid var(--line);
}
.tall th, .tall td, .tall caption { padding-left: .6rem; }
.tall thead th { position: sticky; top: 0; background: var(--card); }
th { color: var(--quiet); font-weight: 600; }
.n { text-align: right; }
.hash { font: .8rem ui-monospace, "DejaVu Sans Mono", monospace; }
.hash { white-space: normal; overflow-wrap: anywhere; }
pre { overflow-x: auto; font: .8rem/1.4 ui-monospace, "DejaVu Sans Mono", monospace; }
a { color: var(--accent); }
figure { margin: .6rem 0 1.4rem; }
figcaption { color: var(--quiet); font-size: .9rem; max-width: 75ch; }
figure img {
  width: 100%; min-width: 38rem; height: auto;
  background: #fff; border: 1px solid var(--line); padding: .4rem;
}
button, select {
  font: inherit; color: var(--ink); background: var(--card); border: 1px solid var(--line);
  border-radius: .3rem; padding: .25rem .6rem; min-height: 2.2rem;
}
td button {
  border: 0; background: none; color: var(--accent); text-decoration: underline; padding: 0 .2rem;
  min-height: 0;
}
button:focus-visible, select:focus-visible, svg:focus-visible, summary:focus-visible, .scroll:focus-visible {
  outline: 2px solid var(--accent); outline-offset: 2px;
}
.bar { display: flex; flex-wrap: wrap; gap: .5rem; align-items: center; margin: .6rem 0; }
tr.on td { background: color-mix(in srgb, var(--accent) 16%, transparent); }
.map { width: 100%; height: auto; display: block; border: 1px solid var(--line); }
.plane { fill: var(--plane); }
.track path {
  fill: none; stroke: hsl(var(--h) 72% var(--track-l)); stroke-linecap: round; stroke-linejoin: round;
  vector-effect: non-scaling-stroke;
}
.track .late { stroke-width: 4px; opacity: .38; }
.track .now { stroke-width: 1.1px; }
.track { cursor: pointer; }
.track:hover .now { stroke-width: 2.2px; }
.map.some .track { opacity: .22; }
.map.some .track.on { opacity: 1; }
.map.some .track.on .now { stroke-width: 2px; }
.dot { fill: var(--ink); stroke: var(--plane); stroke-width: 2px; vector-effect: non-scaling-stroke; }
#chart svg { display: block; width: 100%; height: auto; touch-action: pan-y; }
#chart text { fill: var(--quiet); font-size: 11px; }
#chart .title { fill: var(--ink); font-size: 12px; font-weight: 600; }
#chart .grid { stroke: var(--line); stroke-width: 1; }
#chart .bound { stroke: var(--quiet); stroke-width: 1; stroke-dasharray: 5 4; }
#chart .curve { fill: none; stroke-width: 1.6; stroke-linejoin: round; }
#chart .fill { stroke: none; opacity: var(--band); }
#chart .cursor { stroke: var(--ink); stroke-width: 1; }
#read { min-height: 3rem; font-variant-numeric: tabular-nums; font-size: .9rem; margin: .4rem 0; }
#read span { display: inline-block; margin-right: 1rem; white-space: nowrap; }
.key {
  display: inline-block; width: .8rem; height: .8rem; margin-right: .3rem;
  vertical-align: -.05rem; border-radius: .15rem;
}
.legend { display: flex; flex-wrap: wrap; gap: .2rem 1rem; margin: .3rem 0; }
.legend { font-size: .9rem; color: var(--quiet); }
@media print { .bar, #read { display: none; } .scroll.tall { max-height: none; } }
"""
