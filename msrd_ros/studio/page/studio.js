// The page beside the scene: shows what the studio tells, asks for what is pressed.

const RATES = [0.05, 0.1, 0.25, 0.5, 1, 0];
export const $ = (id) => document.getElementById(id);

let socket = null;
export let state = {};
let kind = "standard";
let scrubbing = false;
let asked = 0;
export let me = 0;
const waiting = new Map();

// -- the connection ------------------------------------------------------------------------------

function connect() {
  socket = new WebSocket(`ws://${location.host}/live`);
  socket.onopen = () => { $("lost").hidden = true; };
  socket.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.type === "state") show(message);
    else if (message.type === "hello") me = message.browser;
    else hear(message);
  };
  socket.onclose = () => {
    $("lost").hidden = false;
    waiting.clear();
    setTimeout(connect, 1000);
  };
}

export function ask(verb, values = {}, then = null) {
  if (socket.readyState !== WebSocket.OPEN) return say("not sent: the studio does not answer", false);
  const id = ++asked;
  if (then) waiting.set(id, then);
  socket.send(JSON.stringify({ do: verb, id, ...values }));
}

function hear(answer) {
  const then = waiting.get(answer.id);
  waiting.delete(answer.id);
  // A list that was looked at again says nothing new: what led to it stays to be read.
  if (answer.text && !(answer.ok && answer.do === "library")) say(answer.text, answer.ok);
  if (then && answer.ok) then(answer);
}

function say(text, ok) {
  $("said").textContent = text;
  $("said").classList.toggle("bad", !ok);
}

// -- what is shown -------------------------------------------------------------------------------

// A text or a table that is written anew has the browser draw anew, scene and all, also if it says the same.
export function write(node, text) {
  if (node.textContent !== String(text)) node.textContent = text;
}

const written = new WeakMap();
export function isNews(node, content) {
  const text = JSON.stringify(content);
  if (written.get(node) === text) return false;
  written.set(node, text);
  return true;
}

function show(news) {
  const known = String(state.strategies);
  state = news;
  if (known !== String(state.strategies)) offerStrategies();
  const name = state.replay ? state.replay.label : state.playing || state.wanted;
  write($("strategy"), name || "no strategy");
  $("strategy").style.borderLeftColor = state.colours[name] || "";
  write($("phase"), state.replay ? `recorded by ${state.replay.subject || "nobody named"}` : phase());
  $("spin").hidden = state.replay || state.spin_rad_s === null || state.spin_rad_s < 1;
  write($("spin"), `spin ${Math.round(state.spin_rad_s)} rad/s`);
  showVerdict();
  showStop();
  showTime();
  showRates();
  showNodes();
  window.dispatchEvent(new CustomEvent("studio-state", { detail: state }));
  for (const button of $("strategies").children)
    offered(button);
  $("feed-on").classList.toggle("chosen", state.feeds_on);
  write($("feed-on"), state.feeds_on ? "No more balls" : "Feed on and on");
}

// What the executor has no policy for can be chosen ahead, and is said to be missing.
function offered(button) {
  const { name } = button.dataset;
  button.classList.toggle("chosen", name === state.wanted);
  const absent = name !== "" && state.driven && !state.playable.includes(name);
  button.classList.toggle("absent", absent);
  button.title = absent ? "The executor has no policy for it now; Learn has the runs that do" : "";
}

function phase() {
  if (!state.driven) return "nobody drives the arm";
  if (!state.enabled) return "stopped";
  if (state.paused) return "time stands";
  return state.playing ? "plays" : "waits for a ball";
}

function showVerdict() {
  const verdict = state.replay ? null : state.verdict;
  const text = state.replay ? state.replay.verdict : verdict && verdict.text;
  $("verdict").hidden = !text;
  if (!text) return;
  const where = verdict && verdict.landing_m ? ` at ${verdict.landing_m.map((v) => v.toFixed(2)).join(", ")} m` : "";
  const spin = verdict && verdict.spin_rad_s !== null ? `, spin ${Math.round(verdict.spin_rad_s)} rad/s` : "";
  write($("verdict"), text.replace("_", " ") + where + spin);
  $("verdict").classList.toggle("good", text === "returned");
  $("verdict").classList.toggle("bad", text !== "returned");
}

function showStop() {
  $("stop").disabled = !state.driven;
  $("stop").classList.toggle("stopped", state.driven && !state.enabled);
  if (!state.driven) return write($("stop").firstChild, "No executor drives the arm ");
  write($("stop").firstChild, state.enabled ? "Stop the arm " : "Let the arm move ");
  $("stop").querySelector("kbd").hidden = !state.enabled;
}

function showTime() {
  write($("clock"), `${state.time_s.toFixed(2)} s`);
  write($("pause"), state.paused ? "Go on" : "Pause");
  $("step").disabled = !state.paused;
  for (const id of ["pause", "rate"]) $(id).disabled = !state.simulated;
  if (document.activeElement !== $("rate")) {
    const index = RATES.indexOf(state.rate);
    $("rate").value = index < 0 ? RATES.length - 1 : index;
  }
  write($("rate-shown"), !state.simulated ? "no simulator" : state.rate ? `${state.rate} ×` : "as fast as it goes");
  const replay = state.replay;
  $("scrub").hidden = !replay;
  if (!replay) return;
  $("scrubber").max = replay.length_s;
  if (!scrubbing) $("scrubber").value = replay.time_s;
  write($("run"), replay.runs ? "Hold" : "Run");
  const now = $("now");
  if (now) for (const side of ["x1", "x2"]) now.setAttribute(side, (560 * replay.time_s) / replay.length_s);
  write($("scrub-shown"), `${replay.time_s.toFixed(2)} of ${replay.length_s.toFixed(2)} s`);
}

function showRates() {
  if (!isNews($("rates"), state.rates)) return;
  const rows = Object.entries(state.rates);
  $("no-rates").hidden = rows.length > 0;
  $("rates").hidden = rows.length === 0;
  const share = (count, fed) => `${Math.round((100 * count) / fed)} %`;
  fill($("rates").tBodies[0], rows.map(([name, count]) =>
    [name || "none", count.fed, share(count.struck, count.fed), share(count.returned, count.fed)]));
}

function showNodes() {
  const troubled = state.nodes.filter((node) => !node.alive || node.waits_for || node.complaint).length;
  $("troubles").hidden = troubled === 0;
  write($("troubles"), troubled);
  $("no-nodes").hidden = state.nodes.length > 0;
  if ($("nodes").hidden || !isNews($("accounts"), state.nodes)) return;
  $("accounts").replaceChildren(...state.nodes.map((node) => {
    const account = element("div", "account");
    account.classList.toggle("gone", !node.alive);
    account.classList.toggle("waits", node.waits_for !== "");
    account.append(element("strong", "", node.name), element("p", "", node.alive ? node.message : "not heard of any more"));
    if (node.waits_for) account.append(element("p", "waiting", `waits for ${node.waits_for}`));
    if (node.complaint) account.append(element("p", "complaint", node.complaint));
    return account;
  }));
}

export function element(kind, style, text = "") {
  const made = document.createElement(kind);
  if (style) made.className = style;
  made.textContent = text;
  return made;
}

export function fill(body, rows) {
  body.replaceChildren(...rows.map((cells) => {
    const row = element("tr", "");
    row.append(...cells.map((cell) => element("td", "", cell)));
    return row;
  }));
}

// -- what is pressed -----------------------------------------------------------------------------

function offerStrategies() {
  const offer = (name, text) => {
    const button = element("button", "", text);
    button.dataset.name = name;
    button.style.setProperty("--colour", state.colours[name] || "");
    button.onclick = () => ask("strategy", { name });
    return button;
  };
  $("strategies").replaceChildren(...state.strategies.map((name) => offer(name, name)), offer("", "none"));
}

function ball() {
  if (kind !== "own") return { kind };
  const value = (id) => Number($(id).value);
  return { kind, speed: value("speed"), backspin: value("backspin"), x: value("x"), y: value("y") };
}

function choosePanel(name) {
  for (const tab of document.querySelectorAll("[role=tab]")) {
    tab.setAttribute("aria-selected", String(tab.dataset.panel === name));
    $(tab.dataset.panel).hidden = tab.dataset.panel !== name;
  }
  if (name === "strokes") look();
  window.dispatchEvent(new CustomEvent("studio-panel", { detail: name }));
}

// -- recorded strokes ----------------------------------------------------------------------------

let rows = [];
export let chosen = [];
let sorted = "bag";
let laid = {};
const KEYS = {
  bag: (row) => row.bag,
  label: (row) => row.label,
  subject: (row) => row.subject,
  verdict: (row) => row.verdict,
  spin: (row) => (row.spin_rad_s ? row.spin_rad_s[1] : Infinity),
  landing: (row) => (row.landing_m ? row.landing_m[0] : Infinity),
};

function look() {
  ask("library", { discarded: $("discarded").checked }, (answer) => {
    rows = answer.rows;
    const here = new Set(rows.map((row) => row.bag));
    chosen = chosen.filter((bag) => here.has(bag));
    list();
  });
}

function list() {
  const wanted = $("filter").value.toLowerCase();
  const said = (row) => [row.label, row.does, row.subject, row.verdict, row.bag, ...row.flags].join(" ").toLowerCase();
  const key = KEYS[sorted];
  const shown = rows
    .filter((row) => said(row).includes(wanted) && (!$("outliers").checked || row.marks.length))
    .sort((a, b) => (key(a) < key(b) ? -1 : key(a) > key(b) ? 1 : a.bag < b.bag ? -1 : 1));
  $("counted").textContent = `${shown.length} of ${rows.length}`;
  const body = $("bags").tBodies[0];
  fill(body, shown.map((row) => [
    "", "", row.label, row.subject,
    row.spin_rad_s ? Math.round(row.spin_rad_s[1]) : "–",
    row.landing_m ? row.landing_m[0].toFixed(2) : "–",
    row.verdict === "accepted" ? "✓" : row.verdict.replace("_", " "),
  ]));
  shown.forEach((row, index) => {
    const line = body.rows[index];
    line.dataset.bag = row.bag;
    line.classList.toggle("chosen", chosen.includes(row.bag));
    line.classList.toggle("discarded", row.discarded !== "");
    line.cells[6].classList.toggle("refused", row.verdict !== "accepted");
    line.cells[2].title = row.does;
    line.cells[6].title = row.detail || row.verdict;
    line.cells[0].append(...marks(row));
    line.cells[1].append(thumbnail(row));
    line.onclick = (event) => choose(row, event.ctrlKey || event.metaKey || event.shiftKey);
  });
  tellEdits();
}

function marks(row) {
  const made = [];
  const dot = (colour, title) => {
    const mark = element("span", "mark");
    mark.style.background = colour;
    mark.title = title;
    made.push(mark);
  };
  if (laid[row.bag]) dot(laid[row.bag], "laid over the others in this colour");
  if (row.marks.length) dot("var(--warn)", row.marks.join("; "));
  if (row.flags.length) dot("var(--strong)", row.flags.join("; "));
  return made;
}

// The ball's path from the side, the net in the middle.
function thumbnail(row) {
  const svg = drawn("svg", { viewBox: "0 0 58 22" });
  const place = ([x, , z]) => `${(29 + 13 * x).toFixed(1)},${(20 - 14 * (z - 0.76)).toFixed(1)}`;
  svg.append(
    drawn("path", { d: "M11 20H47M29 20V17.5", stroke: "#9aa3af", fill: "none" }),
    drawn("polyline", { points: row.ball_path_m.map(place).join(" "), stroke: "#e07b00", fill: "none", "stroke-width": 1.3 }),
  );
  return svg;
}

export function drawn(kind, values) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", kind);
  for (const [name, value] of Object.entries(values)) made.setAttribute(name, value);
  return made;
}

function choose(row, more) {
  if (!more) chosen = [row.bag];
  else if (chosen.includes(row.bag)) chosen = chosen.filter((bag) => bag !== row.bag);
  else chosen = [...chosen, row.bag];
  for (const line of $("bags").tBodies[0].rows) line.classList.toggle("chosen", chosen.includes(line.dataset.bag));
  if (!more) ask("replay", { bag: row.bag });
  tellEdits();
}

function tellEdits() {
  const one = chosen.length === 1;
  const row = rows.find((other) => other.bag === chosen[0]);
  for (const id of ["show", "relabel", "trim", "flag", "restore"]) $(id).disabled = !one;
  $("compare").disabled = chosen.length < 2;
  $("explain").disabled = chosen.length < 1 || chosen.length > 2;
  $("discard").disabled = chosen.length < 1;
  const remarks = row && one ? [row.bag, row.detail, ...row.marks, ...row.flags].filter(Boolean).join("; ") : "";
  $("about").textContent = remarks || "Click a stroke to see it; with Ctrl several are chosen.";
}

function edit(verb, values = {}) {
  for (const bag of [...chosen]) ask(verb, { bag, ...values }, look);
}

function askText(title, value) {
  const text = window.prompt(title, value);
  return text === null ? null : text.trim();
}

function showTold(answer) {
  const told = answer.strokes[0];
  $("told").hidden = false;
  $("told-title").textContent = told.title;
  const all = told.strategy.flat();
  const low = Math.min(...all), spread = Math.max(...all) - low || 1;
  const length = state.replay ? state.replay.length_s : told.time_s.at(-1);
  const x = (time) => (560 * time) / length;
  const lines = told.strategy.map((values, number) => {
    const points = values.map((value, step) => `${x(told.time_s[step]).toFixed(1)},${(104 - (98 * (value - low)) / spread).toFixed(1)}`);
    const line = drawn("polyline", { points: points.join(" "), fill: "none", "stroke-width": 1.6, "vector-effect": "non-scaling-stroke", stroke: state.colours[told.labels[number]] || "#555" });
    // The same stroke on the other side has the same colour.
    const earlier = told.labels.slice(0, number).some((label) => state.colours[label] === state.colours[told.labels[number]]);
    if (earlier) line.setAttribute("stroke-dasharray", "5 3");
    line.append(drawn("title", {}));
    line.lastChild.textContent = told.labels[number];
    return line;
  });
  const hit = drawn("line", { x1: x(told.hit_s), x2: x(told.hit_s), y1: 0, y2: 110, stroke: "#333", "stroke-dasharray": "2 3", "vector-effect": "non-scaling-stroke" });
  const now = drawn("line", { id: "now", y1: 0, y2: 110, stroke: "#b3261e", "vector-effect": "non-scaling-stroke" });
  $("curves").replaceChildren(...lines, hit, now);
  $("curves").dataset.length = length;
  $("bars").replaceChildren(...told.labels.flatMap((label, number) => {
    const bar = element("i", "");
    bar.style.width = `${100 * told.shares[number]}%`;
    bar.style.background = state.colours[label] || "#555";
    return [element("span", "", label), bar, element("span", "", `${Math.round(100 * told.shares[number])} %`)];
  }));
  $("picture").innerHTML = answer.svg;
  $("save-svg").href = URL.createObjectURL(new Blob([answer.svg], { type: "image/svg+xml" }));
}

function closeTold() {
  $("told").hidden = true;
}

for (const head of document.querySelectorAll("#bags th[data-sort]"))
  head.onclick = () => {
    sorted = sorted === head.dataset.sort ? "bag" : head.dataset.sort;
    for (const other of document.querySelectorAll("#bags th")) other.classList.toggle("sorted", other.dataset.sort === sorted);
    list();
  };
$("show").onclick = () => ask("replay", { bag: chosen[0] });
$("compare").onclick = () => {
  const bags = [...chosen];
  ask("compare", { bags }, (answer) => {
    laid = Object.fromEntries(bags.map((bag, number) => [bag, answer.colours[number]]));
    list();
  });
};
$("explain").onclick = () => ask("explain", { bags: chosen }, showTold);
$("relabel").onclick = () => {
  const label = askText("New label: a-z, 0-9 and hyphen; unlabelled takes it away", rows.find((row) => row.bag === chosen[0]).label);
  if (label) edit("relabel", { label });
};
$("trim").onclick = () => {
  const text = askText("Keep from … to …, in s from the bag's start", "0.1 2.2");
  const [begin, end] = (text || "").split(/[\s,]+/).map(Number);
  if (text) edit("trim", { begin, end });
};
$("flag").onclick = () => {
  const text = askText("Note about this stroke; empty takes its notes off", "");
  if (text !== null) edit(text ? "flag" : "unflag", text ? { text } : {});
};
$("discard").onclick = () => edit("discard");
$("restore").onclick = () => edit("restore");
$("filter").oninput = list;
$("outliers").onchange = list;
$("discarded").onchange = look;
$("enlarge").onclick = () => $("whole").showModal();
$("close-whole").onclick = () => $("whole").close();
$("close-told").onclick = closeTold;
for (const tab of document.querySelectorAll("[role=tab]")) tab.onclick = () => choosePanel(tab.dataset.panel);
for (const button of $("kinds").children)
  button.onclick = () => {
    kind = button.dataset.kind;
    for (const other of $("kinds").children) other.classList.toggle("chosen", other === button);
    $("own").hidden = kind !== "own";
  };
for (const slider of $("own").querySelectorAll("input")) {
  const tell = () => { slider.nextElementSibling.textContent = slider.value; };
  slider.oninput = tell;
  tell();
}
$("other").onsubmit = (event) => {
  event.preventDefault();
  ask("strategy", { name: $("other-name").value.trim() });
};
$("feed").onclick = () => ask("feed", ball());
$("feed-on").onclick = () => ask("feed_on", { on: !state.feeds_on, ...ball() });
$("forget").onclick = () => ask("forget_rates");
$("stop").onclick = () => ask(state.enabled ? "stop" : "enable");
$("pause").onclick = () => ask("pause", { on: !state.paused });
$("step").onclick = () => ask("step");
$("rate").onchange = () => ask("rate", { rate: RATES[Number($("rate").value)] });
$("live").onclick = () => {
  closeTold();
  laid = {};
  list();
  ask("replay", { bag: "" });
};
$("run").onclick = () => ask("seek", state.replay.runs ? { runs: false, time: state.replay.time_s } : { runs: true });
$("scrubber").oninput = () => {
  scrubbing = true;
  ask("seek", { runs: false, time: Number($("scrubber").value) });
};
$("scrubber").onchange = () => { scrubbing = false; };
$("look").onclick = look;

// The space bar stops the arm, wherever the page has its attention; it never lets it move again.
function stopOnSpace(event) {
  if (event.code !== "Space" || event.repeat) return;
  if (event.target.tagName === "INPUT" && event.target.type !== "range") return;
  event.preventDefault();
  ask("stop");
}
window.addEventListener("keydown", stopOnSpace, true);
function settleScene() {
  const scene = $("scene").contentDocument;
  if (scene === null) return; // it could not be loaded; the rest of the page does without
  $("scene").contentWindow.addEventListener("keydown", stopOnSpace, true);
  // What the scene's own page says of itself, ours says beside it.
  const hidden = document.createElement("style");
  hidden.textContent = ".mantine-Notifications-root, .mantine-Paper-root { display: none !important; }";
  scene.head.append(hidden);
  // The scene connects while it has the focus.
  $("scene").contentWindow.focus();
}
$("scene").addEventListener("load", settleScene);
// It may have been there before this file was.
const before = $("scene").contentDocument;
if (before !== null && before.URL !== "about:blank" && before.readyState === "complete") settleScene();
connect();
