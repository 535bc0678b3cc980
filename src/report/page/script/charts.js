// Charts: the page has them drawn. This shows and hides their lines, moves their cursors and fills the values below.
// Models are switched on and off for all figures, lines by the legend of a figure.

// The models that are off, for all figures.
const modelsOff = new Set();
const charts = [];

const MOST_FLAT = 3;
const MOST_BANDS = 2;
const MOST_NAMED_OFF = 4;

// A group of a line in a panel: its name, its model, its parts in the drawing, and its value at each level or at all.
const linesOf = (panel) => {
  const lines = new Map();
  for (const part of panel.querySelectorAll("[data-line]")) {
    const { line: name, model } = part.dataset;
    const line = lines.get(name) || lines.set(name, { name, model, parts: [], values: new Map(), everywhere: [] }).get(name);
    line.parts.push(part);
    line.isCurve ||= part.classList.contains("curve");
    for (const title of part.querySelectorAll("title")) {
      const level = title.parentNode.dataset.level;
      if (level) line.values.set(level, title.textContent); else line.everywhere.push(title.textContent);
      title.textContent = `${name}${level ? " at " + level : ""}: ${title.textContent}`;
    }
  }
  return [...lines.values()];
};

// The address of the items behind a point, in the list below.
const itemsOf = (point) => {
  const { items: model, light, family } = point.closest("[data-items]").dataset;
  const filters = Object.entries({ model, light, level: point.dataset.level, family });
  return "#" + filters.filter(([, value]) => value).map(([key, value]) => key + "=" + encodeURIComponent(value)).join("&");
};

class Chart {
  constructor(figure) {
    this.figure = figure;
    this.measure = figure.dataset.measure;
    this.linesOff = new Set();
    this.panels = [...figure.querySelectorAll(".panel")].map((box) => ({
      box, model: box.dataset.model, title: box.querySelector(".panel-title"), svg: box.querySelector("svg"), lines: linesOf(box),
      cursors: [...box.querySelectorAll(".cursor-line")],
    }));
    this.buttons = [...figure.querySelectorAll(".swatch")];
    const models = shortened(unique(this.buttons.map((button) => button.dataset.model).filter((model) => model)));
    const short = (text, model) => models.has(model) && text.startsWith(model) ? models.get(model) + text.slice(model.length) : text;
    this.names = new Map(this.buttons.map(({ dataset: { line, model } }) => [line, short(line, model)]));
    const panelModels = shortened(unique(this.panels.map((panel) => panel.model).filter((model) => model)));
    for (const { model, title } of this.panels) {
      if (panelModels.has(model) && title?.title.startsWith(model)) title.textContent = panelModels.get(model) + title.title.slice(model.length);
    }
    // Many of them hide each other and the curves: they are off at first, and the legend shows it.
    const flat = this.buttons.filter((button) => button.dataset.kind === "flat");
    if (flat.length > MOST_FLAT) flat.forEach((button) => this.linesOff.add(button.dataset.line));
    for (const button of this.buttons) {
      const { line } = button.dataset;
      button.querySelector("span").textContent = this.names.get(line);
      button.addEventListener("click", () => {
        if (!this.linesOff.delete(line)) this.linesOff.add(line);
        this.update();
      });
    }
    // Each is written as in "L3 (6 EV)".
    this.levels = figure.dataset.levels.split("|").filter((level) => level);
    this.slider = figure.querySelector(".cursor input");
    if (this.slider) {
      this.slider.addEventListener("input", () => this.move(Number(this.slider.value)));
      this.at = Number(this.slider.value);
      for (const panel of this.panels) {
        for (const kind of ["pointermove", "pointerdown"]) panel.svg.addEventListener(kind, (event) => this.point(panel, event));
      }
    }
    figure.addEventListener("click", (event) => {
      const point = event.target.closest(".to-items");
      if (point) location.hash = itemsOf(point);
    });
  }

  get level() { return this.levels[this.at]?.split(" ")[0]; }

  isOn(line, panel) {
    return !this.linesOff.has(line.name) && !modelsOff.has(line.model) && !modelsOff.has(panel.model);
  }

  move(at) {
    if (at === this.at || !this.levels[at]) return;
    this.at = at;
    this.slider.value = at;
    this.update();
  }

  // Moves the cursor to the level of a panel that is nearest to the pointer.
  point({ svg, cursors }, event) {
    const box = svg.getBoundingClientRect();
    const x = (event.clientX - box.left) * svg.viewBox.baseVal.width / box.width;
    const away = (cursor) => Math.abs(parseFloat(cursor.getAttribute("points")) - x);
    const nearest = cursors.reduce((a, b) => away(b) < away(a) ? b : a, cursors[0]);
    if (nearest) this.move(this.levels.findIndex((level) => level.split(" ")[0] === nearest.dataset.level));
  }

  // Shows what is on and the values at the cursor.
  update() {
    for (const button of this.buttons) {
      const { line: name, model } = button.dataset;
      button.setAttribute("aria-pressed", !this.linesOff.has(name));
      button.hidden = modelsOff.has(model) || this.panels.every((panel) => modelsOff.has(panel.model) || !panel.lines.some((line) => line.name === name));
    }
    for (const panel of this.panels) {
      panel.box.hidden = modelsOff.has(panel.model);
      const on = panel.lines.filter((line) => this.isOn(line, panel));
      panel.box.classList.toggle("bands", on.filter((line) => line.isCurve).length <= MOST_BANDS);
      for (const line of panel.lines) line.parts.forEach((part) => part.classList.toggle("off", !on.includes(line)));
      for (const part of panel.box.querySelectorAll("[data-level]")) part.classList.toggle("at", part.dataset.level === this.level);
    }
    if (this.slider) this.table();
  }

  // The values at the cursor: a row for each line, a column for each panel. Panels that share their lines, such as
  // "with noise (1 of 3)", share a column.
  table() {
    this.figure.querySelector(".cursor output").textContent = this.levels[this.at] ?? "";
    const panels = this.panels.filter((panel) => !modelsOff.has(panel.model));
    const columns = new Map();
    for (const panel of panels) {
      const title = panel.title.textContent.replace(/ \(\d+ of \d+\)$/, "");
      columns.set(title, [...(columns.get(title) ?? []), panel]);
    }
    const heads = ["line", ...columns.keys()].map((text) => make("th", text));
    heads.forEach((head) => { head.scope = "col"; });
    const table = make("table"), row = make("tr"), head = make("thead"), body = make("tbody");
    table.append(make("caption", this.level ? `${this.measure} at ${this.level}, with both ends of its band` : this.measure));
    row.append(...heads);
    head.append(row);
    for (const [name, short] of this.names) {
      const cells = [...columns.values()].map((parts) => {
        const line = parts.flatMap((panel) => panel.lines.filter((line) => line.name === name && this.isOn(line, panel)))[0];
        if (!line) return undefined;
        return line.isCurve ? line.values.get(this.level) : line.everywhere.join(", ");
      });
      if (cells.every((cell) => cell === undefined)) continue;
      const row = make("tr"), first = make("th", short);
      row.dataset.line = name;
      first.scope = "row";
      first.title = name;
      row.append(first, ...cells.map((cell) => make("td", cell ?? "–")));
      body.append(row);
    }
    table.append(head, body);
    this.figure.querySelector(".values").replaceChildren(table);
  }

  // Says on paper what is not drawn there.
  note() {
    const models = shortened(unique(this.panels.flatMap((panel) => [panel.model, ...panel.lines.map((line) => line.model)]).filter((model) => model)));
    const off = [...[...models].filter(([model]) => modelsOff.has(model)).map(([, short]) => short), ...[...this.linesOff].map((name) => this.names.get(name))];
    const named = off.slice(0, MOST_NAMED_OFF).join(", ") + (off.length > MOST_NAMED_OFF ? ` and ${off.length - MOST_NAMED_OFF} more` : "");
    const notes = [];
    if (this.level && this.panels.some(({ box }) => !box.hidden && !box.classList.contains("bands"))) notes.push(`Intervals are drawn at ${this.level}.`);
    if (off.length) notes.push(`Not drawn, as they are switched off: ${named}.`);
    this.figure.querySelector(".paper-note").textContent = notes.join(" ");
  }
}

// One row of buttons for the models of all figures. The built-in ones are off at first if there are others.
const modelButtons = () => {
  const box = $("models");
  const lines = charts.flatMap((chart) => chart.panels.flatMap((panel) => [panel.model, ...panel.lines.map((line) => line.model)]));
  const models = unique(lines.filter((model) => model));
  if (!box || models.length < 2) return;
  const isBuiltIn = (model) => model === "random" || model.startsWith("observer");
  if (models.some((model) => !isBuiltIn(model))) models.filter(isBuiltIn).forEach((model) => modelsOff.add(model));
  const names = shortened(models);
  // Rows of tables that are named by a model alone have its short name, too.
  for (const head of document.querySelectorAll("main table tbody th")) {
    const model = head.textContent;
    if (names.has(model) && names.get(model) !== model) { head.textContent = names.get(model); head.title = model; }
  }
  for (const model of models) {
    const button = make("button", names.get(model));
    button.type = "button";
    button.title = model;
    button.setAttribute("aria-pressed", !modelsOff.has(model));
    button.addEventListener("click", () => {
      if (!modelsOff.delete(model)) modelsOff.add(model);
      button.setAttribute("aria-pressed", !modelsOff.has(model));
      charts.forEach((chart) => chart.update());
    });
    box.append(button);
  }
  box.hidden = false;
};

for (const figure of document.querySelectorAll("figure.chart")) charts.push(new Chart(figure));
modelButtons();
charts.forEach((chart) => chart.update());
// The first chart says it for all.
const withItems = charts.find((chart) => chart.figure.querySelector(".to-items"));
if (withItems) withItems.figure.querySelector(".to-items-note").hidden = false;
addEventListener("beforeprint", () => charts.forEach((chart) => chart.note()));
