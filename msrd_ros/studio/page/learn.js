// The tab Learn: what is learned from, how far training is, what came of the runs.

import { $, ask, chosen, drawn, element, fill, state, write } from "./studio.js";

const RUN_COLOURS = ["#12569c", "#c4560b"];
const LEFT = 38, RIGHT = 430, TOP = 8, BOTTOM = 128;
const FIGURES = [
  { text: "balls returned", names: ["returned/"], share: true },
  { text: "discriminator: loss", names: ["training/discriminator_loss"] },
  { text: "discriminator: told right (dashed: of the policies)", names: ["training/demonstrations_right", "training/generated_right"], share: true },
  { text: "reward of what is played", names: ["training/reward"] },
  { text: "entropy of the policies", names: ["training/entropy"] },
  { text: "KL divergence of a step", names: ["training/kl"] },
];

let runs = [];
let shown = [];
let told = [];
let last = "";

const percent = (share) => `${Math.round(100 * share)} %`;
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

// -- what is learned from ------------------------------------------------------------------------

function offerDemonstrations() {
  ask("demonstrations", {}, (answer) => {
    const checked = new Set([...document.querySelectorAll("#sources input:checked")].map((box) => box.id));
    for (const source of ["own", "shipped"]) {
      const boxes = Object.entries(answer[source]).map(([label, count]) => {
        const choice = element("label", ""), box = element("input", "");
        Object.assign(box, { type: "checkbox", id: `learn-${source}-${label}`, name: source, value: label });
        box.checked = checked.has(box.id);
        choice.append(box, ` ${label} `, element("span", "hint", `${count}`));
        return choice;
      });
      $(`${source}-labels`).replaceChildren(...boxes);
      $(`${source}-part`).hidden = boxes.length === 0;
    }
    $("no-demonstrations").hidden = Object.keys(answer.own).length > 0;
    $("run-name").placeholder = answer.name;
    if (!$("iterations").value) $("iterations").value = answer.iterations;
  });
  $("learn-chosen").disabled = chosen.length === 0;
  if (!chosen.length) $("learn-chosen").checked = false;
  $("learn-chosen-count").textContent = chosen.length;
}

function labels(source) {
  return [...document.querySelectorAll(`#sources input[name=${source}]:checked`)].map((box) => box.value);
}

function start(event) {
  event.preventDefault();
  const wanted = {
    name: $("run-name").value.trim(),
    own: labels("own"),
    shipped: labels("shipped"),
    bags: $("learn-chosen").checked ? chosen : [],
    iterations: Number($("iterations").value),
    seed: Number($("seed").value),
  };
  ask("train", wanted, began);
}

function began(answer) {
  shown = [answer.run];
  $("run-name").value = "";
  $("lessons").open = false;
  look();
}

// -- how far it is -------------------------------------------------------------------------------

function hear() {
  const learning = state.learning;
  $("learning").hidden = !learning.phase && !learning.ended;
  $("end-training").hidden = !["begins", "learns"].includes(learning.phase);
  $("start-training").disabled = learning.phase !== "";
  $("training-mark").hidden = !learning.phase;
  $("learning-bar").hidden = !learning.planned || !learning.phase;
  $("learning-bar").max = learning.planned;
  $("learning-bar").value = learning.iteration;
  write($("learning-said"), account(learning));
  $("learning-said").classList.toggle("bad", learning.failed);
  write($("policy-rule"), rule());
  const now = [learning.phase, learning.run, learning.iteration].join(" ");
  if (now === last || $("learn").hidden) return;
  last = now;
  look();
}

function rule() {
  if (!state.driven) return "No executor is there to play what is learned.";
  if (state.simulated) return "The executor gets new policies after every fifth iteration; Play has their strategies then.";
  return "A real arm: its executor takes new policies only while its parameter accept_policy lets it.";
}

function account(learning) {
  const far = `iteration ${learning.iteration} of ${learning.planned}`;
  if (learning.phase === "begins") return `${learning.run}: bags are read, and policies cloned from them`;
  if (learning.phase === "learns") return `${learning.run}: ${far}, ${length(learning.seconds_left)} left`;
  if (learning.phase === "ends") return `${learning.run}: ${far}; ends after this one, with a checkpoint`;
  if (learning.phase === "elsewhere") return `Somebody else's trainer is at work${learning.planned ? `: ${far}` : ""}.`;
  return learning.ended;
}

function length(seconds) {
  return seconds < 90 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} min`;
}

// -- runs ----------------------------------------------------------------------------------------

function look() {
  ask("runs", {}, (answer) => {
    runs = answer.runs;
    shown = shown.filter((name) => runs.some((run) => run.name === name));
    if (!shown.length && runs.length) shown = [runs[0].name];
    list();
    if (shown.length) ask("curves", { runs: shown }, (found) => { told = found.runs; draw(); });
    else { told = []; draw(); }
  });
}

function list() {
  $("no-runs").hidden = runs.length > 0;
  $("runs").hidden = runs.length === 0;
  const body = $("runs").tBodies[0];
  fill(body, runs.map((run) => [
    run.name, run.state, far(run), strokes(run),
    run.returned.length ? percent(mean(run.returned)) : "–",
  ]));
  [...body.rows].forEach((row, number) => {
    const run = runs[number];
    row.dataset.run = run.name;
    row.title = run.trouble || run.labels.join(", ");
    row.classList.toggle("chosen", shown.includes(run.name));
    if (run.trouble) row.cells[1].classList.add("refused");
    row.onclick = (event) => {
      if (!event.ctrlKey && !event.metaKey) shown = [run.name];
      else if (shown.includes(run.name)) shown = shown.filter((name) => name !== run.name);
      else shown = [...shown, run.name].slice(-2);
      look();
    };
  });
  const one = shown.length === 1 && runs.find((run) => run.name === shown[0]);
  $("go-on").disabled = !one || !one.goes_on || state.learning.phase !== "";
  $("play-run").disabled = !one || !one.plays;
}

function far(run) {
  const { iteration, planned } = run.state === "running" ? state.learning : { iteration: run.iterations, planned: run.planned };
  return planned ? `${iteration} of ${planned}` : "–";
}

function strokes(run) {
  return Object.values(run.demonstrations).reduce((sum, count) => sum + count, 0);
}

// -- curves, rates, matrix -----------------------------------------------------------------------

function draw() {
  $("results").hidden = told.length === 0;
  if (!told.length) return;
  $("results-title").textContent = told.map((run) => run.name).join(" and ");
  const figure = FIGURES[$("figure").value];
  const lines = told.length > 1 ? told.flatMap((run, number) => ofRun(run, figure, RUN_COLOURS[number])) : ofOne(told[0], figure);
  plot($("learning-curves"), lines, figure.share);
  $("legend").replaceChildren(...lines.map((line) => {
    const entry = element("span", "", line.text);
    entry.style.setProperty("--colour", line.colour);
    entry.classList.toggle("dashed", line.dashed);
    return entry;
  }));
  showRates();
  showMatrix();
}

function named(run, name) {
  return Object.keys(run.curves).filter((found) => found === name || (name.endsWith("/") && found.startsWith(name)));
}

// Each strategy by itself; the same stroke on the other side has the same colour.
function ofOne(run, figure) {
  const made = [];
  for (const [turn, name] of figure.names.entries())
    for (const found of named(run, name)) {
      const text = found.split("/")[1].replaceAll("_", " ");
      const colour = (name.endsWith("/") && state.colours[text]) || RUN_COLOURS[0];
      const dashed = turn > 0 || (name.endsWith("/") && made.some((line) => line.colour === colour));
      made.push({ text, colour, dashed, points: run.curves[found] });
    }
  return made;
}

// One line a figure: the mean of the strategies at each iteration.
function ofRun(run, figure, colour) {
  return figure.names.flatMap((name, turn) => {
    const curves = named(run, name).map((found) => run.curves[found]);
    if (!curves.length) return [];
    const points = curves[0].map(([iteration], step) => [iteration, mean(curves.map((curve) => (curve[step] || curve.at(-1))[1]))]);
    return [{ text: run.name + (turn ? " (of the policies)" : ""), colour, dashed: turn > 0, points }];
  });
}

function plot(svg, lines, share) {
  const points = lines.flatMap((line) => line.points);
  svg.replaceChildren();
  if (!points.length) {
    const none = drawn("text", { x: (LEFT + RIGHT) / 2, y: (TOP + BOTTOM) / 2, "text-anchor": "middle" });
    none.textContent = "nothing of this yet";
    return void svg.append(none);
  }
  const values = points.map(([, value]) => value);
  const [low, high] = share ? [0, 1] : [Math.min(...values), Math.max(...values)];
  const end = Math.max(1, ...points.map(([iteration]) => iteration));
  const x = (iteration) => LEFT + ((RIGHT - LEFT) * iteration) / end;
  const y = (value) => BOTTOM - ((BOTTOM - TOP) * (value - low)) / (high - low || 1);
  const write = (text, at) => {
    const made = drawn("text", at);
    made.textContent = text;
    svg.append(made);
  };
  for (const part of [0, 0.5, 1]) {
    const value = low + part * (high - low), iteration = Math.round(part * end);
    svg.append(drawn("path", { d: `M${LEFT} ${y(value)}H${RIGHT}`, class: "grid" }));
    write(share ? percent(value) : Number(value.toPrecision(3)), { x: LEFT - 4, y: y(value) + 4, "text-anchor": "end" });
    write(part === 1 ? `iteration ${iteration}` : iteration, { x: x(iteration), y: BOTTOM + 15, "text-anchor": part === 1 ? "end" : "middle" });
  }
  for (const line of lines) {
    const made = drawn("polyline", { points: line.points.map(([step, value]) => `${x(step).toFixed(1)},${y(value).toFixed(1)}`).join(" "), stroke: line.colour, "stroke-dasharray": line.dashed ? "5 3" : "none" });
    made.append(drawn("title", {}));
    made.lastChild.textContent = line.text;
    svg.append(made);
  }
}

function showRates() {
  const table = $("run-rates");
  const of = (run, label, name) => {
    const share = run[name][run.labels.indexOf(label)];
    return share === undefined ? "–" : percent(share);
  };
  if (told.length === 1) {
    const [run] = told;
    fill(table.tHead, [["strategy", "taught", "struck", "returned"]]);
    fill(table.tBodies[0], run.labels.map((label) => [label, run.demonstrations[label] || 0, of(run, label, "struck"), of(run, label, "returned")]));
    return;
  }
  fill(table.tHead, [["", ...told.map((run) => run.name)]]);
  const known = [...new Set(told.flatMap((run) => run.labels))];
  fill(table.tBodies[0], [
    ["iterations", ...told.map(far)],
    ["strokes taught", ...told.map(strokes)],
    ["seconds", ...told.map((run) => Math.round(run.seconds))],
    ["seed", ...told.map((run) => run.seed)],
    ...known.map((label) => [`${label} returned`, ...told.map((run) => of(run, label, "returned"))]),
    ["own strokes ranked highest", ...told.map(ranked)],
  ]);
  [...table.tHead.rows[0].cells].slice(1).forEach((cell, number) => { cell.style.color = RUN_COLOURS[number]; });
}

function ranked(run) {
  if (run.groups.length < 2) return "–";
  const right = run.matrix.filter((row, number) => row[number] === Math.max(...row)).length;
  return `${right} of ${run.groups.length}`;
}

function showMatrix() {
  const [run] = told, several = told.length === 1 && run.groups.length > 1;
  $("matrix-part").hidden = !several;
  $("matrix-alone").hidden = told.length > 1 || run.groups.length !== 1;
  if (!several) return;
  fill($("matrix").tHead, [["S of", ...run.groups.map((_, number) => number + 1)]]);
  fill($("matrix").tBodies[0], run.matrix.map((row, number) => [`${number + 1} ${run.groups[number]}`, ...row.map((value) => value.toFixed(2))]));
  run.matrix.forEach((row, number) => row.forEach((value, column) => {
    const cell = $("matrix").tBodies[0].rows[number].cells[column + 1];
    cell.style.background = `rgb(18 86 156 / ${value.toFixed(2)})`;
    cell.style.color = value > 0.55 ? "#fff" : "";
    cell.classList.toggle("own", column === number);
  }));
  $("matrix-said").textContent = `Own strokes ranked highest: ${ranked(run)}.`;
}

$("figure").replaceChildren(...FIGURES.map((figure, number) => Object.assign(element("option", "", figure.text), { value: number })));
$("figure").onchange = draw;
$("train").onsubmit = start;
$("end-training").onclick = () => ask("end_training");
$("go-on").onclick = () => ask("go_on", { name: shown[0] }, began);
$("play-run").onclick = () => ask("play_run", { name: shown[0] });
$("look-runs").onclick = look;
window.addEventListener("studio-state", hear);
window.addEventListener("studio-panel", ({ detail }) => {
  if (detail !== "learn") return;
  offerDemonstrations();
  look();
});
