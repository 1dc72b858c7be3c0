// Teach by hand: ghosts of the paddle in two views, the paddle in the person's own hand, and what is kept.

import { $, ask, drawn, element, isNews, me, write } from "./studio.js";

const SCALE = 220; // pixels of a view a metre
const BLADE_M = 0.075;
const MOMENTS = ["wind-up", "contact", "follow-through"];
const PING_MS = 100; // a page that says nothing for half a second has let go
const SEND_MS = 40;

let state = null;
let teach = null;
let mode = "sketch";
let again = null; // asks for the same once more
let settled = 0; // the last stroke that was kept, discarded or labelled
let drag = null; // of a ghost: which, in which view, where, and turns that are not sent yet
let dragged = null; // the view that it is dragged in
let hand = null; // of the paddle itself: offset from the pointer, and where it is wanted
let sliding = false;

// -- views: what is right and what is up in them, and how a turn in them turns the paddle -----------

const SIDE = { svg: $("teach-side-view"), width: 436, height: 190, right: 0, up: 2, turn: "turn_y", sign: -1, says: "from the side" };
const TOP = { svg: $("teach-top-view"), width: 436, height: 105, right: 0, up: 1, turn: "turn_z", sign: 1, says: "from above" };

// What is in the middle of a view: the contact as it was begun, so that nothing moves under the pointer.
let middle = [-1.65, 0, 1.05];
let middleOf = "";

const toView = (view, u, v, at = [middle[view.right], middle[view.up]]) =>
  [view.width / 2 + SCALE * (u - at[0]), view.height / 2 - SCALE * (v - at[1])];

function fromView(view, event, at = [middle[view.right], middle[view.up]]) {
  const box = view.svg.getBoundingClientRect();
  const x = ((event.clientX - box.left) / box.width) * view.width;
  const y = ((event.clientY - box.top) / box.height) * view.height;
  return [at[0] + (x - view.width / 2) / SCALE, at[1] - (y - view.height / 2) / SCALE];
}

const points = (view, rows, at) => rows.map(([u, v]) => toView(view, u, v, at).map((n) => n.toFixed(1)).join(",")).join(" ");
const line = (view, rows, stroke, more = {}, at) => drawn("polyline", { points: points(view, rows, at), fill: "none", stroke, "stroke-width": 1.5, ...more });
const flat = (view, rows) => rows.map((row) => [row[view.right], row[view.up]]);

function text(x, y, words) {
  const made = drawn("text", { x, y });
  made.textContent = words;
  return made;
}

// -- the sketch ------------------------------------------------------------------------------------

function placeOf(moment) {
  if (drag && drag.moment === moment) return drag.position;
  return teach.sketch.ghosts[moment].position;
}

const drawings = new Map();

function drawSketch(view) {
  const sketch = teach.sketch;
  // What is drawn already stays, under the pointer, too.
  const drawing = JSON.stringify([sketch, drag, middle]);
  if (drawings.get(view) === drawing) return;
  drawings.set(view, drawing);
  const bad = sketch.violations.length > 0;
  const parts = [
    line(view, flat(view, sketch.paddle_path), bad ? "#b3261e" : "#12569c", { "stroke-dasharray": "4 3", opacity: 0.7 }),
    line(view, flat(view, sketch.ball_path), "#e07b00"),
    text(6, 14, view.says),
  ];
  if (view === SIDE) parts.unshift(line(view, [[-1.37, 0.76], [0.5, 0.76]], "#123e6e", { "stroke-width": 4 }));
  for (const moment of MOMENTS) parts.push(drawGhost(view, moment, sketch.ghosts[moment]));
  view.svg.replaceChildren(...parts);
}

function faceIn(view, ghost) {
  const [n, m] = [ghost.normal[view.right], ghost.normal[view.up]];
  const size = Math.hypot(n, m);
  return size > 0.05 ? [-m / size, n / size] : [0, 1];
}

function drawGhost(view, moment, ghost) {
  const place = placeOf(moment);
  let [a, b] = faceIn(view, ghost);
  const [x, y] = toView(view, place[view.right], place[view.up]);
  const reach = SCALE * BLADE_M;
  // The ring stands above, where there is room.
  if (b < 0 !== y - (reach + 12) * Math.abs(b) < 8) [a, b] = [-a, -b];
  const group = drawn("g", { class: ghost.bad ? "ghost bad" : "ghost", "data-moment": moment });
  const grip = drawn("circle", { cx: x, cy: y, r: 15, class: "grip" });
  const turn = drawn("circle", { cx: x + (reach + 12) * a, cy: y - (reach + 12) * b, r: 6, class: "turn" });
  grip.append(titled(`Drag: where the paddle is at the ${moment}`));
  turn.append(titled(`Drag: how the paddle is turned at the ${moment}`));
  group.append(
    drawn("line", { x1: x, y1: y, x2: x + (reach + 12) * a, y2: y - (reach + 12) * b, stroke: "currentColor", "stroke-width": 1 }),
    drawn("line", { x1: x - reach * a, y1: y + reach * b, x2: x + reach * a, y2: y - reach * b, class: "blade" }),
    drawn("circle", { cx: x, cy: y, r: 4, fill: "currentColor" }),
    text(x + 10, y + 16, moment), grip, turn,
  );
  grip.onpointerdown = (event) => takeGhost(view, moment, event, false);
  turn.onpointerdown = (event) => takeGhost(view, moment, event, true);
  return group;
}

function titled(words) {
  const made = drawn("title", {});
  made.textContent = words;
  return made;
}

function takeGhost(view, moment, event, turns) {
  if (teach.leader !== null) return;
  event.preventDefault();
  const position = [...placeOf(moment)];
  const [u, v] = fromView(view, event);
  drag = { moment, turns, position, offset: [position[view.right] - u, position[view.up] - v], turn: 0, changed: false,
    angle: Math.atan2(v - position[view.up], u - position[view.right]) };
  dragged = view;
  view.svg.setPointerCapture(event.pointerId);
}

function moveGhost(event) {
  const [view, position] = [dragged, drag.position];
  const [u, v] = fromView(view, event);
  if (drag.turns) {
    const angle = Math.atan2(v - position[view.up], u - position[view.right]);
    drag.turn += Math.atan2(Math.sin(angle - drag.angle), Math.cos(angle - drag.angle));
    drag.angle = angle;
  } else {
    // What is dragged out of the view could not be taken again.
    const held = (value, at, size) => Math.min(Math.max(value, at - size), at + size);
    position[view.right] = held(u + drag.offset[0], middle[view.right], (view.width / 2 - 12) / SCALE);
    position[view.up] = held(v + drag.offset[1], middle[view.up], (view.height / 2 - 12) / SCALE);
  }
  drag.changed = true;
  drawSketch(SIDE);
  drawSketch(TOP);
}

function sendGhost() {
  if (!drag || !drag.changed) return;
  const [x, y, z] = drag.position;
  const turn = { turn_y: 0, turn_z: 0, [dragged.turn]: dragged.sign * drag.turn };
  ask("teach_move", { moment: drag.moment, x, y, z, ...turn });
  drag.turn = 0;
  drag.changed = false;
}

// -- the paddle in the person's hand ---------------------------------------------------------------

const GUIDE_MIDDLE = [0, 0];

function drawGuide() {
  const view = SIDE;
  const { guide, guided } = teach;
  drawings.clear();
  const parts = [text(6, 14, "in the plane of the stroke"), line(view, guide.ball_path, "#e07b00", {}, GUIDE_MIDDLE)];
  for (const moment of MOMENTS) {
    const [x, y] = toView(view, ...guide.ghosts[moment], GUIDE_MIDDLE);
    parts.push(drawn("circle", { cx: x, cy: y, r: moment === "contact" ? 9 : 5, fill: "none", stroke: "#12569c", "stroke-dasharray": "3 2" }));
    parts.push(text(x + 11, y + 15, moment === "contact" ? "meet it here" : moment));
  }
  parts.push(line(view, [guide.ghosts["wind-up"], guide.ghosts.contact, guide.ghosts["follow-through"]], "#12569c", { "stroke-dasharray": "4 3", opacity: 0.5 }, GUIDE_MIDDLE));
  if (guided) {
    const colour = guided.beyond.length ? "#b3261e" : "#16794a";
    if (guided.ball) {
      const [x, y] = toView(view, ...guided.ball, GUIDE_MIDDLE);
      parts.push(drawn("circle", { cx: x, cy: y, r: 5, fill: "#e07b00", id: "teach-ball" }));
    }
    const [p, q] = toView(view, ...guided.pacer, GUIDE_MIDDLE);
    parts.push(drawn("circle", { cx: p, cy: q, r: SCALE * 0.1, fill: "#16794a", opacity: 0.3, id: "teach-pacer" }));
    const [x, y] = toView(view, ...guided.paddle, GUIDE_MIDDLE);
    parts.push(drawn("rect", { x: x - 4, y: y - 16, width: 8, height: 32, rx: 3, fill: colour, id: "teach-paddle" }));
    if (hand) {
      const [u, v] = toView(view, ...hand.place, GUIDE_MIDDLE);
      parts.push(drawn("circle", { cx: u, cy: v, r: 13, fill: "none", stroke: colour, "stroke-width": 2 }));
    }
  }
  view.svg.replaceChildren(...parts);
}

function takePaddle(event) {
  if (!teach.guided || teach.leader !== me || !teach.leads) return;
  event.preventDefault();
  const [u, v] = fromView(SIDE, event, GUIDE_MIDDLE);
  hand = { offset: [teach.guided.paddle[0] - u, teach.guided.paddle[1] - v], place: [...teach.guided.paddle] };
  SIDE.svg.setPointerCapture(event.pointerId);
  sendHand();
}

function sendHand() {
  if (hand) ask("teach_drag", { along: hand.place[0], up: hand.place[1] });
}

function letGo() {
  if (hand) ask("teach_release");
  hand = null;
}

let sent = 0;
let due = 0;
function soon(send) {
  // Not more often than the studio plans, and the newest in any case.
  clearTimeout(due);
  const wait = sent + SEND_MS - performance.now();
  if (wait > 0) return void (due = setTimeout(() => soon(send), wait));
  sent = performance.now();
  send();
}

for (const view of [SIDE, TOP]) {
  view.svg.addEventListener("pointerdown", (event) => { if (view === SIDE && mode === "guide") takePaddle(event); });
  view.svg.addEventListener("pointermove", (event) => {
    if (drag && dragged === view) {
      moveGhost(event);
      soon(sendGhost);
    } else if (hand && view === SIDE) {
      const [u, v] = fromView(SIDE, event, GUIDE_MIDDLE);
      hand.place = [u + hand.offset[0], v + hand.offset[1]];
      soon(sendHand);
      drawGuide();
    }
  });
  for (const end of ["pointerup", "pointercancel"])
    view.svg.addEventListener(end, () => {
      sendGhost();
      drag = null;
      letGo();
    });
}
setInterval(sendHand, PING_MS);

// -- what is shown ---------------------------------------------------------------------------------

window.addEventListener("studio-state", (event) => {
  state = event.detail;
  teach = state.teach;
  if (!$("teach").hidden) show();
});

function show() {
  if (!$("teach-names").children.length)
    $("teach-names").replaceChildren(...state.strategies.map((name) => drawnOption(name)));
  const sketch = teach.sketch;
  $("teach-drawing").hidden = $("teach-modes").hidden = !sketch;
  $("teach-none").hidden = Boolean(sketch);
  if (sketch) {
    const key = `${sketch.name} ${sketch.side}`;
    if (key !== middleOf) [middleOf, middle] = [key, [...sketch.ghosts.contact.position]];
    showDrawing(sketch);
    showLead(sketch);
  }
  showStrokes();
}

function drawnOption(name) {
  const made = element("option", "");
  made.value = name;
  return made;
}

function showDrawing(sketch) {
  const guides = mode === "guide";
  SIDE.svg.classList.toggle("guided", guides && teach.leads);
  TOP.svg.toggleAttribute("hidden", guides);
  TOP.svg.style.display = guides ? "none" : "";
  $("teach-times").hidden = guides;
  $("teach-slow").hidden = !guides;
  if (guides) drawGuide();
  else if (!drag) for (const view of [SIDE, TOP]) drawSketch(view);
  if (!sliding)
    for (const name of ["contact", "swing", "follow"]) $(`teach-${name}`).value = sketch[`${name}_s`];
  for (const input of document.querySelectorAll("#teach-times input, #teach-slow input"))
    write(input.previousElementSibling, Number(input.value).toFixed(2));
  const beyond = guides && teach.guided ? teach.guided.beyond : sketch.violations;
  if (isNews($("teach-violations"), beyond))
    $("teach-violations").replaceChildren(...beyond.slice(0, 3).map((words) => element("li", "", words)));
  const where = sketch.landing_m[0] === null ? "" : ` at ${sketch.landing_m.map((v) => v.toFixed(2)).join(", ")} m`;
  const spin = sketch.spin_rad_s === null ? "" : `, spin ${Math.round(sketch.spin_rad_s)} rad/s`;
  write($("teach-foretold"), sketch.violations.length
    ? "The arm cannot do this:"
    : `Foretold: ${sketch.outcome.replace("_", " ")}${where}${spin}`);
  $("teach-foretold").classList.toggle("bad", sketch.violations.length > 0 || !sketch.returned);
  $("teach-foretold").hidden = guides && !sketch.violations.length;
}

function showLead(sketch) {
  const mine = teach.leader === me;
  const others = teach.leader !== null && !mine;
  write($("teach-turn"), others ? `browser ${teach.leader} leads` : guideHint() || teach.turn);
  write($("teach-lead"), mine ? "Let go" : mode === "guide" ? "Let me guide" : "Lead it");
  $("teach-lead").disabled = others || (!mine && sketch.violations.length > 0);
  $("teach-vary").hidden = mode === "guide";
  for (const part of $("teach-vary").elements) part.disabled = teach.leader !== null || sketch.violations.length > 0;
  $("teach-enable").hidden = !teach.real;
  const series = teach.series;
  $("teach-series").hidden = !series && !teach.trouble;
  const redrawn = series && series.refused ? `, ${series.refused} beyond the arm's limits were drawn again` : "";
  const told = series ? `${series.kept} of ${series.wanted} variations kept, ${series.led} led${redrawn}. ` : "";
  write($("teach-series"), told + teach.trouble);
}

function guideHint() {
  if (!teach.guided || teach.leader !== me) return "";
  if (!teach.leads) return teach.turn;
  return hand ? "you lead: keep on the green disc, through the ball" : "take the green paddle and drag it through the ball";
}

function showStrokes() {
  const last = teach.strokes[0];
  $("teach-last").hidden = !last;
  $("teach-strokes").hidden = !last;
  if (!last) return;
  const kept = last.bag && !last.discarded;
  $("teach-last").classList.toggle("bad", !kept);
  const where = last.landing_m ? ` at ${last.landing_m.map((v) => v.toFixed(2)).join(", ")} m` : "";
  const became = last.discarded ? "discarded" : last.bag ? `kept as ${last.bag}` : `not kept: ${last.why_not}`;
  write($("teach-verdict"), `${last.number}. ${last.label}: ${last.outcome.replace("_", " ")}${where} – ${became}`);
  const open = kept && teach.leader === null;
  $("teach-keep").disabled = !open || settled === last.number;
  $("teach-discard").disabled = $("teach-label").disabled = !open;
  $("teach-again").disabled = teach.leader !== null || !again;
  if (!isNews($("teach-strokes"), teach.strokes)) return;
  $("teach-strokes").tBodies[0].replaceChildren(...teach.strokes.map((one) => {
    const row = element("tr", one.discarded ? "discarded" : "");
    const landing = one.landing_m ? one.landing_m[0].toFixed(2) : "–";
    const cells = [one.number, one.label, one.note.replace(/ of .*/, ""), landing, one.bag ? "✓" : "✗"];
    row.append(...cells.map((cell) => element("td", "", cell)));
    row.title = one.bag || one.why_not;
    return row;
  }));
}

// -- what is pressed -------------------------------------------------------------------------------

const name = () => $("teach-name").value.trim();

function begin(verb, values) {
  again = () => ask(verb, { name: name(), ...values() });
  again();
}

$("teach-begin").onsubmit = (event) => {
  event.preventDefault();
  middleOf = "";
  ask("teach_begin", { name: name(), side: $("teach-side").value });
};
for (const button of $("teach-modes").querySelectorAll("button"))
  button.onclick = () => {
    mode = button.dataset.mode;
    for (const other of $("teach-modes").querySelectorAll("button")) other.classList.toggle("chosen", other === button);
    show();
  };
$("teach-lead").onclick = () => {
  if (teach.leader === me) ask("teach_stop");
  else if (mode === "guide") begin("teach_guide", () => ({ rate: Number($("teach-rate").value) }));
  else begin("teach_lead", () => ({}));
};
$("teach-vary").onsubmit = (event) => {
  event.preventDefault();
  begin("teach_vary", () => ({ count: Number($("teach-count").value), spread: $("teach-spread").value }));
};
$("teach-enable").onclick = () => ask("teach_enable");
for (const id of ["teach-contact", "teach-swing", "teach-follow"]) {
  const seconds = (one) => Number($(`teach-${one}`).value);
  $(id).oninput = () => {
    sliding = true;
    const times = { contact: seconds("contact"), swing: seconds("swing"), follow: seconds("follow") };
    soon(() => ask("teach_time", times));
  };
  $(id).onchange = () => { sliding = false; };
}

const DO = {
  k: () => ask("teach_keep", {}, () => { settled = teach.strokes[0].number; show(); }),
  a: () => {
    const last = teach.strokes[0];
    if (last.bag && !last.discarded && settled !== last.number) ask("teach_discard", {}, () => again());
    else again();
  },
  d: () => ask("teach_discard"),
  l: () => {
    const label = window.prompt("New label: a-z, 0-9 and hyphen; unlabelled takes it away", teach.strokes[0].label);
    if (label) ask("teach_label", { label: label.trim() }, () => { settled = teach.strokes[0].number; });
  },
};
const BUTTONS = { k: "teach-keep", a: "teach-again", d: "teach-discard", l: "teach-label" };
for (const [key, id] of Object.entries(BUTTONS)) $(id).onclick = DO[key];

function onKey(event) {
  const button = BUTTONS[event.key] && $(BUTTONS[event.key]);
  if (!button || $("teach").hidden || event.repeat || event.ctrlKey || event.metaKey || event.altKey) return;
  if (["INPUT", "SELECT"].includes(event.target.tagName) && event.target.type !== "range") return;
  if (!button.disabled && !$("teach-last").hidden) button.click();
}
window.addEventListener("keydown", onKey);
$("scene").addEventListener("load", () => $("scene").contentWindow.addEventListener("keydown", onKey));

window.addEventListener("studio-panel", (event) => {
  if (event.detail === "teach") return void (teach && show());
  ask("teach_hide");
});
