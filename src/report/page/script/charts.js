// Charts: the data of each figure, drawn at the width there is. A figure has one cursor, which its pointer and its slider move, and the
// values at the cursor stand below it. Models are switched on and off for all figures, lines by the legend of a figure.

const SPACE = "http://www.w3.org/2000/svg";
const draw_ = (tag, attributes, ...inside) => {
  const element = document.createElementNS(SPACE, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...inside);
  return element;
};

// Colours are those of the style sheet; from the seventh line on they come again, with other dashes and marks.
const COLOURS = 6;
const CHANCE_STYLE = 27;
// From this style on, a curve is that of a reference model, in the colour of the text.
const REFERENCE_STYLES = 1000;
const DASHES = ["", "9 5", "3 4", "14 5", "9 4 3 4", "18 4"];
const WORDS_ALONE = ["14 6", "14 3 3 3", "6 3 2 3"];
const CHANCE = "2 5";
const colourOf = (line) => line.kind === "flat" || line.style >= REFERENCE_STYLES ? "ink" : "line-" + line.style % COLOURS;
const dashOf = (line, place) => {
  if (line.kind !== "flat") return DASHES[(line.style + Math.floor(line.style / COLOURS)) % DASHES.length];
  return line.style === CHANCE_STYLE ? CHANCE : WORDS_ALONE[place % WORDS_ALONE.length];
};
const MARKS = [
  (x, y) => draw_("circle", { cx: x, cy: y, r: 4, class: "filled" }),
  (x, y) => draw_("rect", { x: x - 4, y: y - 4, width: 8, height: 8, class: "filled" }),
  (x, y) => draw_("path", { d: `M${x} ${y - 5}L${x + 5} ${y + 4}H${x - 5}Z`, class: "filled" }),
  (x, y) => draw_("path", { d: `M${x} ${y - 6}L${x + 5} ${y}L${x} ${y + 6}L${x - 5} ${y}Z`, class: "filled" }),
  (x, y) => draw_("path", { d: `M${x - 4} ${y - 4}L${x + 4} ${y + 4}M${x + 4} ${y - 4}L${x - 4} ${y + 4}`, class: "stroked" }),
  (x, y) => draw_("circle", { cx: x, cy: y, r: 4, class: "stroked" }),
];
const markOf = (line, x, y) => {
  if (line.kind === "marks") return draw_("circle", { cx: x, cy: y, r: 5, class: "stroked" });
  return MARKS[(line.style + Math.floor(line.style / COLOURS)) % MARKS.length](x, y);
};

// The address of the items behind a point of a line, in the list below; none if the page has no such list.
const itemsOf = (line, level) => {
  if (!line.items || !level || !$("explorer")) return undefined;
  const { model, light, family } = line.items;
  return "#" + Object.entries({ model, light, level: level.name, family }).filter(([, value]) => value).map(([key, value]) => key + "=" + encodeURIComponent(value)).join("&");
};
// A mark that leads to its items by a click. Keys have the filters of the list for that: a drawing with links in it is no image.
const linked = (address, name, x, y, mark) => {
  const group = draw_("g", { class: "to-items", "data-address": address },
    draw_("title", {}, `the items of ${name}`), draw_("circle", { cx: x, cy: y, r: 9, class: "target" }), mark);
  group.addEventListener("click", () => { location.hash = address; });
  return group;
};

// The models that are off, for all figures.
const modelsOff = new Set();
const charts = [];

// Widest plots have the names of lines at their right ends; others have the legend alone.
const NAMED_FROM = 480;
const LETTER = 7.2;
const BAND_LINES = 2;
const BAR_STEP = 3;
const MOST_FLAT = 3;
const MOST_NAMED = 14;
// Widths of a panel on paper (A4 with margins of 10 mm has 718 pixels), by how many panels a figure has.
const MOST_NAMED_OFF = 4;
const paperWidth = (panels) => panels === 1 ? 520 : panels === 2 || panels === 4 ? 350 : 232;

class Chart {
  constructor(figure, data) {
    this.figure = figure;
    this.data = data;
    this.linesOff = new Set();
    this.lines = new Map();
    for (const panel of data.panels) for (const line of panel.lines) if (!this.lines.has(line.name)) this.lines.set(line.name, line);
    this.models = shortened(unique(data.panels.map((panel) => panel.model).filter((model) => model)));
    const models = shortened(unique([...this.lines.values()].map((line) => line.model).filter((model) => model)));
    const short = (line) => line.model && line.name.startsWith(line.model) ? models.get(line.model) + line.name.slice(line.model.length) : line.name;
    this.names = new Map([...this.lines.values()].map((line) => [line.name, short(line)]));
    const flat = [...this.lines.values()].filter((line) => line.kind === "flat" && line.style !== CHANCE_STYLE);
    this.flatPlaces = new Map(flat.map((line, place) => [line.name, place]));
    // Many of them hide each other and the curves: they are off at first, and the legend says so.
    if (flat.length > MOST_FLAT) flat.forEach((line) => this.linesOff.add(line.name));
    const levels = new Map();
    for (const panel of data.panels) for (const level of panel.levels) levels.set(level.name, { ...level, unit: panel.unit });
    this.levels = [...levels.values()].sort((a, b) => a.value - b.value);
    // The last level of the first panel that has levels: later panels may have levels in another unit.
    const last = data.panels.find((panel) => panel.levels.length)?.levels.at(-1).name;
    this.at = this.levels.findIndex((level) => level.name === last);
    this.build();
  }

  build() {
    const plot = make("div", undefined, "plot");
    this.legend = make("div", undefined, "legend");
    this.legend.setAttribute("role", "group");
    this.legend.setAttribute("aria-label", "lines of this figure");
    this.buttons = new Map();
    for (const [name, line] of this.lines) {
      const button = make("button", undefined, "swatch " + colourOf(line));
      button.type = "button";
      button.title = name;
      const key = draw_("svg", { width: 34, height: 12, "aria-hidden": "true" });
      key.append(draw_("path", { d: "M0 6H34", class: "line", "stroke-dasharray": dashOf(line, this.flatPlaces.get(name) ?? 0) }));
      if (line.kind !== "flat") key.append(markOf(line, 17, 6));
      button.append(key, this.names.get(name));
      button.addEventListener("click", () => {
        if (this.linesOff.has(name)) this.linesOff.delete(name); else this.linesOff.add(name);
        this.draw();
      });
      this.buttons.set(name, button);
      this.legend.append(button);
    }
    this.grid = make("div", undefined, "panels");
    this.boxes = this.data.panels.map((panel) => {
      const box = make("div", undefined, "panel");
      const title = make("p", this.titleOf(panel), "panel-title");
      title.title = panel.title;
      const room = make("div", undefined, "room");
      box.append(title, room);
      this.grid.append(box);
      return { panel, box, room };
    });
    const label = make("label", "values at ", "cursor");
    this.slider = make("input");
    Object.assign(this.slider, { type: "range", min: 0, max: Math.max(this.levels.length - 1, 0), step: 1, value: this.at });
    this.slider.setAttribute("aria-label", "level of the values below");
    this.level = make("output");
    this.slider.addEventListener("input", () => this.move(Number(this.slider.value)));
    label.append(this.slider, this.level);
    this.values = make("div", undefined, "values scroll");
    this.values.setAttribute("aria-live", "polite");
    this.values.tabIndex = 0;
    this.values.setAttribute("role", "group");
    this.values.setAttribute("aria-label", "values at the level");
    const fold = make("details", undefined, "fold");
    fold.append(make("summary", "Values"), label, this.values);
    fold.open = true;
    const body = make("div", undefined, this.data.panels.length > 1 ? "body" : "body single");
    body.append(this.grid, fold);
    this.paperNote = make("p", undefined, "paper-only small");
    plot.append(this.legend, body, this.paperNote, " ");
    // The first chart says it for all.
    if (!charts.length && this.data.panels.some((panel) => panel.lines.some((line) => itemsOf(line, panel.levels[0])))) {
      this.legend.after(make("p", "A click on a point shows the images, questions and replies behind it.", "small"));
    }
    this.figure.querySelector(".drawing").after(plot);
    this.figure.classList.add("drawn");
    new ResizeObserver(() => {
      const width = Math.round(this.grid.clientWidth);
      if (width && width !== this.width) { this.width = width; this.draw(); }
    }).observe(this.grid);
  }

  titleOf(panel) {
    const short = this.models.get(panel.model);
    return short && panel.title.startsWith(panel.model) ? short + panel.title.slice(panel.model.length) : panel.title;
  }

  isOn(line, panel) {
    return !this.linesOff.has(line.name) && !modelsOff.has(line.model) && !modelsOff.has(panel.model);
  }

  move(at) {
    if (at === this.at || at < 0 || at >= this.levels.length) return;
    this.at = at;
    this.slider.value = at;
    this.draw();
  }

  // Draws for paper, or for the window again. What is not drawn is said there.
  print(isPaper) {
    const panels = this.data.panels.filter((panel) => !modelsOff.has(panel.model)).length;
    this.paper = isPaper ? paperWidth(panels) : undefined;
    const models = this.data.panels.flatMap((panel) => [panel.model, ...panel.lines.map((line) => line.model)]);
    const shortest = shortened(unique(models.filter((model) => model)));
    const off = [...[...shortest].filter(([model]) => modelsOff.has(model)).map(([, short]) => short), ...[...this.linesOff].map((name) => this.names.get(name))];
    const named = off.slice(0, MOST_NAMED_OFF).join(", ") + (off.length > MOST_NAMED_OFF ? ` and ${off.length - MOST_NAMED_OFF} more` : "");
    const curves = this.data.panels.some((panel) => panel.lines.filter((line) => line.kind === "curve" && this.isOn(line, panel)).length > BAND_LINES);
    const notes = [];
    if (curves && this.levels[this.at]) notes.push(`Intervals are drawn at ${this.levels[this.at].name}.`);
    if (off.length) notes.push(`Not drawn, as they are switched off: ${named}.`);
    this.paperNote.textContent = notes.map((note) => note + " ").join("");
    this.draw();
  }

  draw() {
    for (const [name, button] of this.buttons) {
      button.setAttribute("aria-pressed", !this.linesOff.has(name));
      button.hidden = this.data.panels.every((panel) => modelsOff.has(panel.model) || !panel.lines.some((l) => l.name === name && !modelsOff.has(l.model)));
    }
    for (const { panel, box, room } of this.boxes) {
      const lines = panel.lines.filter((line) => this.isOn(line, panel));
      box.hidden = modelsOff.has(panel.model);
      box.style.width = this.paper ? this.paper + "px" : "";
      if (!box.hidden) room.replaceChildren(this.picture(panel, lines, this.paper ?? (room.clientWidth || this.width)));
    }
    this.table();
  }

  picture(panel, lines, width) {
    const names = lines.map((line) => this.names.get(line.name));
    const isNamed = width >= NAMED_FROM && lines.length > 0 && lines.length <= MOST_NAMED;
    const right = isNamed ? Math.min(Math.max(...names.map((name) => name.length)) * LETTER + 26, width * 0.36) : 14;
    const height = Math.round(Math.min(Math.max(width * 0.5, this.paper ? 142 : 230), this.paper ? 166 : 340));
    const area = { left: 46, top: 10, right: width - right, bottom: height - 52 };
    const x = (value) => area.left + 10 + (area.right - area.left - 20) * (panel.end > 0 ? value / panel.end : 0.5);
    const y = (share) => area.bottom - (area.bottom - area.top) * Math.min(Math.max(share, 0), 1);
    const svg = draw_("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img" });
    svg.append(draw_("title", {}, `${panel.title}: ${this.data.measure} by level; the values are in the table below`));
    for (let step = 0; step <= 5; step++) {
      const at = y(step / 5);
      svg.append(draw_("path", { d: `M${area.left} ${at}H${area.right}`, class: step ? "grid" : "axis" }));
      svg.append(draw_("text", { x: area.left - 7, y: at + 4, class: "end" }, String(step * 20)));
    }
    svg.append(draw_("text", { class: "middle", transform: `translate(12 ${(area.top + area.bottom) / 2}) rotate(-90)` }, this.data.measure));
    const cursor = this.levels[this.at];
    let last = -Infinity;
    for (const level of panel.levels) {
      const at = x(level.value), reach = level.name.length * LETTER / 2 + 3;
      svg.append(draw_("path", { d: `M${at} ${area.bottom}v4`, class: "axis" }));
      if (at - reach < last) continue;
      last = at + reach;
      svg.append(draw_("text", { x: at, y: area.bottom + 18, class: "middle" }, level.name));
      svg.append(draw_("text", { x: at, y: area.bottom + 32, class: "middle soft" }, String(level.value)));
    }
    svg.append(draw_("text", { x: (area.left + area.right) / 2, y: height - 4, class: "middle soft" }, panel.axis));
    const here = cursor && panel.levels.some((level) => level.name === cursor.name);
    if (here) svg.append(draw_("path", { d: `M${x(cursor.value)} ${area.top}V${area.bottom}`, class: "cursor-line" }));
    const curves = lines.filter((line) => line.kind === "curve");
    const ends = [];
    lines.forEach((line, index) => {
      const group = draw_("g", { class: colourOf(line) });
      const dash = dashOf(line, this.flatPlaces.get(line.name) ?? 0);
      if (line.kind === "flat") {
        group.append(draw_("path", { d: `M${area.left} ${y(line.share)}H${area.right}`, class: "line flat", "stroke-dasharray": dash }));
        ends.push({ at: y(line.share), name: names[index], colour: colourOf(line) });
      } else if (line.points.length) {
        const points = line.points.map((point) => [x(point.x[1]), y(point.y[0])]);
        if (line.kind === "curve") {
          if (curves.length <= BAND_LINES) {
            const upper = line.points.map((point) => `${x(point.x[1])} ${y(point.y[2])}`);
            const lower = line.points.map((point) => `${x(point.x[1])} ${y(point.y[1])}`).reverse();
            group.append(draw_("path", { d: `M${[...upper, ...lower].join("L")}Z`, class: "band" }));
          } else if (here) {
            const point = line.points.find((p) => p.x[1] === cursor.value);
            // Side by side, so that each can be told from the others.
            const beside = x(point?.x[1]) + (curves.indexOf(line) - (curves.length - 1) / 2) * BAR_STEP;
            if (point) group.append(draw_("path", { d: `M${beside} ${y(point.y[1])}V${y(point.y[2])}`, class: "bar" }));
          }
          group.append(draw_("path", { d: "M" + points.map((p) => p.join(" ")).join("L"), class: "line", "stroke-dasharray": dash }));
        } else {
          for (const point of line.points) {
            group.append(draw_("path", { d: `M${x(point.x[0])} ${y(point.y[0])}H${x(point.x[2])}`, class: "bar" }));
          }
        }
        points.forEach(([px, py], place) => {
          const mark = markOf(line, px, py);
          const level = line.kind === "curve" && panel.levels.find((own) => own.value === line.points[place].x[1]);
          const address = itemsOf(line, level);
          group.append(address ? linked(address, `${line.name} at ${level.name}`, px, py, mark) : mark);
        });
        ends.push({ at: points[points.length - 1][1], from: points[points.length - 1][0], name: names[index], colour: colourOf(line) });
      }
      svg.append(group);
    });
    if (isNamed) this.endNames(svg, ends, area, right);
    const move = (event) => {
      const rect = svg.getBoundingClientRect(), at = (event.clientX - rect.left) * width / rect.width;
      const there = this.levels.map((level, index) => [Math.abs(x(level.value) - at), index, level])
        .filter(([, , level]) => panel.levels.some((own) => own.name === level.name));
      there.sort((a, b) => a[0] - b[0]);
      if (there.length) this.move(there[0][1]);
    };
    svg.addEventListener("pointermove", move);
    svg.addEventListener("pointerdown", move);
    return svg;
  }

  // Names at the right ends of lines, pushed apart, each with a leader to its line.
  endNames(svg, ends, area, right) {
    const STEP = 15, letters = Math.floor((right - 22) / LETTER);
    ends.sort((a, b) => a.at - b.at);
    const places = ends.map((end) => end.at);
    for (let i = 1; i < places.length; i++) places[i] = Math.max(places[i], places[i - 1] + STEP);
    const over = Math.max((places[places.length - 1] ?? 0) - area.bottom - 6, 0);
    if (over) {
      places[places.length - 1] -= over;
      for (let i = places.length - 2; i >= 0; i--) places[i] = Math.min(places[i], places[i + 1] - STEP);
    }
    ends.forEach((end, i) => {
      const group = draw_("g", { class: end.colour });
      group.append(draw_("path", { d: `M${(end.from ?? area.right) + 6} ${end.at}L${area.right + 10} ${places[i]}`, class: "leader" }));
      const name = end.name.length > letters ? this.shortened(end.name, ends, letters) : end.name;
      group.append(draw_("text", { x: area.right + 14, y: places[i] + 4, class: "name" }, name));
      svg.append(group);
    });
  }

  // A name in fewer letters. That of the only model without images goes without the model; of several, the model is cut.
  shortened(name, ends, letters) {
    const cut = (text, room) => text.length > room ? text.slice(0, Math.max(room - 1, 1)) + "…" : text;
    const blind = " without images", brief = ", no image";
    if (!name.endsWith(blind)) return cut(name, letters);
    const blinds = ends.filter((end) => end.name.endsWith(blind));
    if (blinds.length === 1 && blind.length <= letters) return blind.trim();
    return cut(name.slice(0, -blind.length), letters - brief.length) + brief;
  }

  // The values at the cursor: a row for each line, a column for each panel.
  table() {
    const level = this.levels[this.at];
    this.level.textContent = level ? ` ${level.name} (${level.value} ${level.unit})` : "";
    const panels = this.data.panels.filter((panel) => !modelsOff.has(panel.model));
    const table = make("table"), head = make("tr");
    table.append(make("caption", level ? `${this.data.measure} at ${level.name}, with both ends of its band` : this.data.measure));
    const corner = make("th", "line");
    corner.scope = "col";
    head.append(corner, ...panels.map((panel) => { const th = make("th", this.titleOf(panel)); th.scope = "col"; return th; }));
    const thead = make("thead"), body = make("tbody");
    thead.append(head);
    for (const name of this.lines.keys()) {
      const cells = panels.map((panel) => {
        const line = panel.lines.find((l) => l.name === name);
        if (!line || !this.isOn(line, panel)) return undefined;
        if (line.kind === "flat") return line.text;
        if (line.kind === "marks") return line.points.map((point) => point.text).join(", ");
        return line.points.find((point) => point.x[1] === level?.value && panel.levels.some((own) => own.name === level.name))?.text;
      });
      if (cells.every((cell) => cell === undefined)) continue;
      const row = make("tr"), first = make("th", this.names.get(name));
      row.dataset.line = name;
      first.scope = "row";
      first.title = name;
      row.append(first, ...cells.map((cell) => make("td", cell ?? "–")));
      body.append(row);
    }
    table.append(thead, body);
    this.values.replaceChildren(table);
  }
}

// One row of buttons for the models of all figures. The built-in ones are off at first if there are others.
const modelButtons = () => {
  const box = $("models");
  const lines = charts.flatMap((chart) => chart.data.panels.flatMap((panel) => [panel.model, ...panel.lines.map((line) => line.model)]));
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
      if (modelsOff.has(model)) modelsOff.delete(model); else modelsOff.add(model);
      button.setAttribute("aria-pressed", !modelsOff.has(model));
      charts.forEach((chart) => chart.draw());
    });
    box.append(button);
  }
  box.hidden = false;
};

for (const figure of document.querySelectorAll("figure.chart")) {
  const data = figure.querySelector("script[type='application/json']");
  if (data) charts.push(new Chart(figure, JSON.parse(data.textContent)));
}
modelButtons();
charts.forEach((chart) => chart.draw());
addEventListener("beforeprint", () => charts.forEach((chart) => chart.print(true)));
addEventListener("afterprint", () => charts.forEach((chart) => chart.print(false)));
