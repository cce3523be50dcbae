"use strict";
// Marks by kind: {name, points, metres, direction}; `open` are the corners of the one that is being drawn.
const KINDS = ["lines", "zones", "masks", "lengths"];
const COLOURS = { lines: "#ffd640", zones: "#5ec8ff", masks: "#ff6e6e", lengths: "#7dff8a" };
const CORNERS = { lines: 2, lengths: 2 };
const NEAR_PX = 9, LENS = 8;
const get = (id) => document.getElementById(id);
const canvas = get("canvas"), lens = get("lens");
const picture = new Image();
let marks = { lines: [], zones: [], masks: [], lengths: [] };
let open = [], dragged = null, scale = 1, mouse = null, ended = false;

function say(text, bad) {
  get("status").textContent = text;
  get("status").className = bad ? "bad" : "";
}

function each(visit) {
  for (const kind of KINDS) marks[kind].forEach((mark, k) => visit(mark, kind, k));
}

function freeName(kind) {
  const taken = new Set();
  each((mark) => taken.add(mark.name));
  let k = 1;
  const stem = kind.slice(0, -1);
  while (taken.has(`${stem}-${k}`)) k += 1;
  return `${stem}-${k}`;
}

function finish() {
  const kind = get("kind").value;
  const least = CORNERS[kind] || 3;
  if (open.length < least) {
    say(`A polygon needs three corners; there are ${open.length}.`, true);
    return;
  }
  const mark = { name: freeName(kind), points: open };
  if (kind === "lengths") Object.assign(mark, { metres: "", direction: "along" });
  marks[kind].push(mark);
  open = [];
  say("");
  show();
}

function at(event) {
  const box = canvas.getBoundingClientRect();
  const round = (value) => Math.round(value * 10) / 10;
  return [round((event.clientX - box.left) / scale), round((event.clientY - box.top) / scale)];
}

function near(place) {
  let best = null, least = NEAR_PX / scale;
  each((mark) => mark.points.forEach((point, k) => {
    const away = Math.hypot(point[0] - place[0], point[1] - place[1]);
    if (away < least) [best, least] = [{ mark, k }, away];
  }));
  return best;
}

function resize() {
  const chosen = Number(get("zoom").value);
  const room = get("stage").clientWidth || picture.naturalWidth;
  scale = chosen || Math.min(1, room / picture.naturalWidth);
  canvas.width = Math.round(picture.naturalWidth * scale);
  canvas.height = Math.round(picture.naturalHeight * scale);
  draw();
}

function path(pen, points, closed) {
  pen.beginPath();
  points.forEach(([x, y], k) => (k ? pen.lineTo(x * scale, y * scale) : pen.moveTo(x * scale, y * scale)));
  if (closed) pen.closePath();
}

function drawMark(pen, mark, kind) {
  const closed = !CORNERS[kind];
  pen.strokeStyle = pen.fillStyle = COLOURS[kind];
  pen.lineWidth = 2;
  path(pen, mark.points, closed);
  if (closed) {
    pen.globalAlpha = 0.2;
    pen.fill();
    pen.globalAlpha = 1;
  }
  pen.stroke();
  for (const [x, y] of mark.points) pen.fillRect(x * scale - 3, y * scale - 3, 6, 6);
  const [x, y] = mark.points[0];
  pen.font = "14px system-ui";
  pen.fillText(kind === "lengths" && mark.metres ? `${mark.metres} m` : mark.name, x * scale + 6, y * scale - 6);
}

function drawGrid(pen) {
  const step = picture.naturalWidth > 1000 ? 100 : 50;
  pen.strokeStyle = "rgba(255,255,255,.35)";
  pen.fillStyle = "#fff";
  pen.font = "11px system-ui";
  pen.lineWidth = 1;
  for (let x = step; x < picture.naturalWidth; x += step) {
    path(pen, [[x, 0], [x, picture.naturalHeight]]);
    pen.stroke();
    pen.fillText(x, x * scale + 2, 11);
  }
  for (let y = step; y < picture.naturalHeight; y += step) {
    path(pen, [[0, y], [picture.naturalWidth, y]]);
    pen.stroke();
    pen.fillText(y, 2, y * scale - 2);
  }
}

function draw() {
  const pen = canvas.getContext("2d");
  pen.drawImage(picture, 0, 0, canvas.width, canvas.height);
  if (get("grid").checked) drawGrid(pen);
  each((mark, kind) => drawMark(pen, mark, kind));
  if (open.length) drawMark(pen, { name: "", points: mouse ? [...open, mouse] : open }, get("kind").value);
  const glass = lens.getContext("2d");
  glass.fillRect(0, 0, lens.width, lens.height);
  if (!mouse) return;
  const side = lens.width / LENS;
  glass.imageSmoothingEnabled = false;
  glass.drawImage(picture, mouse[0] - side / 2, mouse[1] - side / 2, side, side, 0, 0, lens.width, lens.height);
  glass.strokeStyle = "#ffd640";
  glass.strokeRect(lens.width / 2 - LENS / 2, lens.height / 2 - LENS / 2, LENS, LENS);
  get("place").textContent = `x ${mouse[0]}, y ${mouse[1]}`;
}

function field(mark, key, label, more) {
  const input = document.createElement("input");
  input.value = mark[key];
  input.setAttribute("aria-label", label);
  Object.assign(input, more);
  input.addEventListener("input", () => { mark[key] = input.value; draw(); });
  return input;
}

function show() {
  const list = get("list");
  list.replaceChildren();
  each((mark, kind, k) => {
    const row = document.createElement("li");
    row.style.color = COLOURS[kind];
    if (kind === "lengths") {
      const way = document.createElement("select");
      for (const text of ["along", "across"]) way.add(new Option(text, text, false, mark.direction === text));
      way.addEventListener("change", () => { mark.direction = way.value; });
      row.append(field(mark, "metres", "metres", { className: "metres", placeholder: "metres" }), " m ", way, " ");
    } else {
      row.append(field(mark, "name", `name of the ${kind.slice(0, -1)}`), " ");
    }
    const remove = document.createElement("button");
    remove.textContent = "Remove";
    remove.addEventListener("click", () => { marks[kind].splice(k, 1); show(); });
    row.append(remove);
    list.append(row);
  });
  draw();
}

async function save(end) {
  if (open.length) {
    say("Finish what is being drawn first (Enter), or drop it (Esc).", true);
    return;
  }
  try {
    const answer = await fetch(end ? "done" : "save", {
      method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(marks),
    });
    say(await answer.text(), !answer.ok);
    ended = end && answer.ok;
  } catch {
    say("The command has ended: nothing is saved.", true);
  }
}

canvas.addEventListener("mousedown", (event) => { dragged = open.length ? null : near(at(event)); });
window.addEventListener("mousemove", (event) => {
  mouse = event.target === canvas ? at(event) : null;
  if (dragged && mouse) dragged.mark.points[dragged.k] = mouse;
  draw();
});
canvas.addEventListener("mouseup", (event) => {
  if (dragged) {
    dragged = null;
    return;
  }
  if (event.detail > 1 && open.length > 2) {
    finish();
    return;
  }
  open.push(at(event));
  if (open.length === CORNERS[get("kind").value]) finish();
  draw();
});
window.addEventListener("keydown", (event) => {
  if (event.target.tagName === "INPUT") return;
  if (event.key === "Enter") finish();
  if (event.key === "Escape") { open = []; draw(); }
});
window.addEventListener("beforeunload", (event) => { if (open.length && !ended) event.preventDefault(); });
get("kind").addEventListener("change", () => { open = []; draw(); });
get("finish").addEventListener("click", finish);
get("undo").addEventListener("click", () => { open.pop(); draw(); });
get("grid").addEventListener("change", draw);
get("zoom").addEventListener("change", resize);
get("save").addEventListener("click", () => save(false));
get("done").addEventListener("click", () => save(true));
window.addEventListener("resize", resize);
picture.addEventListener("load", async () => {
  marks = await (await fetch("marks.json")).json();
  resize();
  show();
  document.body.dataset.ready = "yes";
});
picture.src = "picture.png";
