"use strict";
// What a person counts against what the counter counted: the pure part, which the tests run, comes first.
const Z95 = 1.959963984540054;

/** Wilson's 95 % interval of a share of `hits` in `of`; [0, 1] of nothing. */
function wilson(hits, of) {
  if (of === 0) return [0, 1];
  const p = hits / of, z2 = Z95 * Z95, middle = p + z2 / (2 * of);
  const half = Z95 * Math.sqrt((p * (1 - p)) / of + z2 / (4 * of * of));
  const down = hits === 0 ? 0 : (middle - half) / (1 + z2 / of);
  return [down, hits === of ? 1 : (middle + half) / (1 + z2 / of)];
}

/**
 * Pair ascending times of a person and of the counter, one to one, no farther apart than `reach` (s).
 * The counter's beyond the stretch from `begin` to `end` only excuse the person's: they are in no number.
 */
function compare(person, counter, begin, end, reach) {
  let i = 0, j = 0, hits = 0, missed = 0, wrong = 0;
  const inside = (t) => t >= begin && t < end;
  while (i < person.length || j < counter.length) {
    if (j === counter.length || (i < person.length && person[i] < counter[j] - reach)) { missed += 1; i += 1; }
    else if (i === person.length || counter[j] < person[i] - reach) { wrong += inside(counter[j]) ? 1 : 0; j += 1; }
    else { hits += inside(counter[j]) ? 1 : 0; i += 1; j += 1; }
  }
  return { hits, missed, wrong };
}

/** Sum over all stretches: what was found of what a person saw, and what of the counter's is right. */
function summary(stretches, presses, direction, reach) {
  const sum = { hits: 0, missed: 0, wrong: 0 };
  stretches.forEach((one, k) => {
    const mine = (presses[k] || []).filter((p) => p.direction === direction).map((p) => p.t).sort((a, b) => a - b);
    const part = compare(mine, one.counted[direction], one.begin, one.end, reach);
    for (const name of Object.keys(sum)) sum[name] += part[name];
  });
  const seen = sum.hits + sum.missed, told = sum.hits + sum.wrong;
  return { ...sum, found: wilson(sum.hits, seen), right: wilson(sum.hits, told), seen, told };
}

if (typeof module !== "undefined") module.exports = { wilson, compare, summary };

if (typeof document !== "undefined") {
  const data = JSON.parse(document.getElementById("data").textContent);
  const video = document.querySelector("video"), say = document.getElementById("say");
  const presses = data.stretches.map(() => []);
  let now = -1;
  const percent = (x) => `${(100 * x).toFixed(1)} %`;
  const tell = () => {
    if (now < 0 || now >= data.stretches.length) return;
    const t = video.currentTime, one = data.stretches[now];
    const phase = t < one.begin ? "get ready" : t < one.end ? "count" : "the last ones";
    const counts = data.directions.map((d) => `${d} ${presses[now].filter((p) => p.direction === d).length}`);
    say.textContent = `stretch ${now + 1} of ${data.stretches.length}: ${phase} · ${counts.join(" · ")}`;
  };
  const next = () => {
    now += 1;
    if (now >= data.stretches.length) { finish(); return; }
    video.currentTime = Math.max(data.stretches[now].begin - data.reach, 0);
    video.play();
  };
  const finish = () => {
    video.pause();
    say.textContent = "done";
    const rows = data.directions.map((d) => {
      const s = summary(data.stretches, presses, d, data.reach);
      const share = (hits, of, ends) => of ? `${percent(hits / of)} (${percent(ends[0])} to ${percent(ends[1])})` : "–";
      return [d, s.seen, s.told, s.missed, s.wrong, share(s.hits, s.seen, s.found), share(s.hits, s.told, s.right)];
    });
    const body = document.querySelector("tbody");
    for (const row of rows) {
      const tr = body.insertRow();
      for (const text of row) tr.insertCell().textContent = text;
    }
    document.getElementById("result").hidden = false;
  };
  document.getElementById("start").addEventListener("click", (event) => { event.target.disabled = true; next(); });
  video.addEventListener("timeupdate", () => {
    tell();
    if (now >= 0 && now < data.stretches.length && video.currentTime >= data.stretches[now].end + data.reach) next();
  });
  video.addEventListener("ended", () => { if (now >= 0 && now < data.stretches.length) next(); });
  document.addEventListener("keydown", (event) => {
    if (now < 0 || now >= data.stretches.length) return;
    const one = data.stretches[now], t = video.currentTime;
    const way = { ArrowLeft: 0, ArrowRight: 1 }[event.key];
    if (way !== undefined && t >= one.begin) presses[now].push({ t, direction: data.directions[way] });
    else if (event.key === "Backspace") presses[now].pop();
    else if (event.key === " ") { if (video.paused) video.play(); else video.pause(); }
    else if (event.key === "-") video.playbackRate = Math.max(video.playbackRate / 2, 0.25);
    else if (event.key === "+") video.playbackRate = Math.min(video.playbackRate * 2, 4);
    else return;
    event.preventDefault();
    tell();
  });
}
