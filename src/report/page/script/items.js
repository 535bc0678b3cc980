// The items of the runs, with their images and the replies to them.

// What a reply hides: controls that turn the direction of text or show nothing are written out.
const HIDDEN = /[\u0000-\u0008\u000b-\u001f\u007f-\u009f\u00ad\u061c\u115f\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb]/g;
const reveal = (element, text) => {
  element.replaceChildren();
  let last = 0;
  for (const found of text.matchAll(HIDDEN)) {
    element.append(text.slice(last, found.index));
    const code = found[0].codePointAt(0).toString(16).toUpperCase().padStart(4, "0");
    element.append(make("span", "⟨U+" + code + "⟩", "hidden-sign"));
    last = found.index + found[0].length;
  }
  element.append(text.slice(last));
};
const plain = (text) => text.replace(HIDDEN, "");

const UNREAD = 26, FAILED = 27, ABSENT = 28;
const letter = (index) => String.fromCharCode(65 + index);

let data, state, shown = [];
const ROWS = 300;

const unpack = async () => {
  const binary = atob($("data").textContent.trim());
  const bytes = Uint8Array.from(binary, (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return JSON.parse(await new Response(stream).text());
};

// What a subject made of an item.
const chosen = (subject, item) => data.strict[subject][item];
// Where nobody knows the true choice, a model is held against its own answer at L0: that of the first item of the question.
const hasTruth = () => !data.lights;
const findReferences = () => {
  if (isOpen() || data.items.every((item) => item.truth !== null)) return;
  data.lights = data.subjects.map((s) => data.subjects.findIndex((o) => o.model === s.model && o.level === "L0" && o.enhancer === null));
  const seen = new Map();
  data.firsts = data.items.map((item, i) => {
    const key = item.question + " " + item.choices;
    if (!seen.has(key)) seen.set(key, i);
    return seen.get(key);
  });
};
const reference = (subject, item) => {
  const { truth } = data.items[item];
  if (truth !== null) return truth;
  const there = subject < 0 ? -1 : data.lights[subject];
  const code = there < 0 ? ABSENT : chosen(there, data.firsts[item]);
  return code < UNREAD ? code : null;
};
const isRight = (subject, item) => chosen(subject, item) === (isOpen() ? BEST_MARK : reference(subject, item));
// Why a reply was not read, or why none came.
const because = (subject, item) => {
  const why = data.reasons[data.why[subject][item]];
  return why ? ` (${why})` : "";
};
const mark = (subject, item) => {
  const code = chosen(subject, item);
  if (code === ABSENT) return ["", "m-none", "not asked"];
  if (isOpen() && code < UNREAD) return openMark(code);
  if (code === FAILED) return ["!", "m-odd", (isOpen() ? "not answered" : "failed") + because(subject, item)];
  if (code === UNREAD) return ["?", "m-odd", (isOpen() ? "not marked" : "not read") + because(subject, item)];
  if (reference(subject, item) === null) return [letter(code), "m-none", "no answer at L0"];
  if (!hasTruth()) return isRight(subject, item) ? ["= " + letter(code), "m-same", SAME] : ["≠ " + letter(code), "m-other", OTHER];
  return isRight(subject, item) ? ["✓ " + letter(code), "m-right", "right"] : ["✗ " + letter(code), "m-wrong", "wrong"];
};
const find = (model, light, level) =>
  data.subjects.findIndex((s) => s.model === model && s.light === light && s.level === level);
// L0 is the untouched frame of every light; a blind model has one condition alone.
const at = (model, light, level) => {
  const there = find(model, light, level);
  return there >= 0 || level !== "L0" ? there : clean(model, light);
};
const clean = (model, light) => data.subjects.find((s) => s.model === model && s.light === light)?.clean ?? -1;
const raw = (subject) => {
  const s = data.subjects[subject];
  return data.subjects.findIndex((o) => o.model === s.model && o.level === s.level && o.variant === s.variant && o.enhancer === null && o.light !== "blind");
};

let drawn = 0;
const drawList = (upTo) => {
  const list = $("list"), subject = subjectNow();
  list.querySelector(".more")?.remove();
  for (; drawn < Math.min(upTo, shown.length); drawn++) {
    const i = shown[drawn], item = data.items[i], question = data.questions[item.question];
    const row = make("li"), button = make("button"), [sign, name, word] = mark(subject, i);
    button.type = "button";
    button.dataset.item = i;
    const badge = make("span", sign + " ", name);
    badge.title = word;
    button.append(badge, plain(question.text || question.id), make("span", data.frames[question.frame], "where"));
    button.addEventListener("click", () => { acted(); go(i); });
    row.append(button);
    list.append(row);
  }
  if (drawn < shown.length) {
    const row = make("li", undefined, "more"), more = make("button", (shown.length - drawn) + " more");
    more.type = "button";
    more.addEventListener("click", () => drawList(drawn + ROWS));
    row.append(more);
    list.append(row);
  }
  current();
};
const current = () => {
  for (const row of $("list").querySelectorAll("button[data-item]")) {
    const here = Number(row.dataset.item) === state.item;
    row.setAttribute("aria-current", here);
    if (here) {
      const list = $("list"), top = row.offsetTop - list.offsetTop;
      if (top < list.scrollTop || top + row.offsetHeight > list.scrollTop + list.clientHeight) list.scrollTop = top - list.clientHeight / 2;
    }
  }
};

const link = () => {
  const said = { item: data.items[state.item].name, model: state.model, light: state.light, level: state.level, family: state.family, against: state.against, show: state.show, words: state.words };
  const parts = Object.entries(said).filter(([k, v]) => v && !(k === "family" && v === "all") && !(k === "show" && v === "all") && !(k === "against" && v === "–"));
  return "#" + parts.map(([k, v]) => k + "=" + encodeURIComponent(v)).join("&");
};

// The address names what is shown from the first act of a person on.
let hasActed = false;
const acted = () => { hasActed = true; };

const refresh = (changed) => {
  choices(changed);
  select();
  $("list").replaceChildren();
  drawn = 0;
  if (!shown.includes(state.item) && shown.length) state.item = shown[0];
  drawList(Math.max(ROWS, shown.indexOf(state.item) + 50));
  draw();
};

const go = (item) => {
  state.item = item;
  const place = shown.indexOf(item);
  if (place >= drawn) drawList(place + 50);
  current();
  draw();
};
const step = (by) => {
  acted();
  const place = shown.indexOf(state.item);
  const next = shown[Math.min(Math.max(place + by, 0), shown.length - 1)];
  if (next !== undefined) go(next);
};

const marks = (i) => {
  const table = $("i-marks");
  table.replaceChildren();
  const there = everyLevel();
  const head = make("tr");
  head.append(...["model", "light", ...there].map((name) => { const th = make("th", name, name === "light" ? "text" : ""); th.scope = "col"; return th; }));
  const thead = make("thead");
  thead.append(head);
  const body = make("tbody");
  table.append(thead, body);
  const now = subjectNow(), names = shortened(unique(data.subjects.map((s) => s.model)));
  for (const model of unique(data.subjects.map((s) => s.model))) {
    for (const light of lights(model)) {
      const row = make("tr");
      const first = make("th", names.get(model)), second = make("td", light === "blind" ? "without images" : light, "text");
      first.scope = "row";
      first.title = model;
      row.append(first, second);
      for (const level of light === "blind" ? [null] : there) {
        const subject = light === "untouched" && level !== "L0" ? -1 : at(model, light, level);
        const own = subject >= 0 && (data.subjects[subject].light === light);
        const [sign, name, word] = subject >= 0 ? mark(subject, i) : ["", "", ""];
        const cell = make("td", own || light === "blind" ? sign : "", name);
        cell.title = word;
        // What was seen without an image lies at no level.
        if (light === "blind") cell.colSpan = there.length;
        if (own) {
          const button = make("button", sign);
          button.type = "button";
          button.title = word;
          button.setAttribute("aria-label", `${sign}, ${word}: ${model}, ${light}, ${level ?? "without images"}`);
          button.setAttribute("aria-current", subject === now);
          cell.dataset.subject = subject;
          button.addEventListener("click", () => { acted(); Object.assign(state, { model, light, level, pictured: level }); refresh(); });
          cell.replaceChildren(button);
        }
        row.append(cell);
      }
      body.append(row);
    }
  }
};

// The answers that were not read or did not come, each with why, and with what was said.
const LONGEST_QUOTE = 120;
const unread = (i) => {
  const names = shortened(unique(data.subjects.map((s) => s.model))), rows = [];
  // The table of all answers has the same of open questions.
  if (isOpen()) return;
  data.subjects.forEach((s, subject) => {
    const code = chosen(subject, i);
    if (code !== UNREAD && code !== FAILED) return;
    const [sign, name, word] = mark(subject, i), row = make("li"), quote = make("q");
    const text = data.texts[data.replies[subject][i]] || "", letters = [...text];
    reveal(quote, letters.length > LONGEST_QUOTE ? letters.slice(0, LONGEST_QUOTE).join("") + " …" : text);
    row.append(make("span", sign + " ", name), `${names.get(s.model)}, ${s.condition}: ${word}`);
    if (text) row.append(code === FAILED ? "; the error: " : "; the reply: ", quote);
    rows.push(row);
  });
  $("i-unread").replaceChildren(...rows);
};

const reply = (subject, i) => {
  if (subject < 0 || chosen(subject, i) === ABSENT) {
    $("r-title").textContent = "";
    $("r-text").textContent = "";
    $("r-mark").textContent = "not asked";
    $("r-mark").className = "m-none";
    $("r-reading").textContent = "";
    $("r-asked").hidden = true;
    $("r-judged").hidden = true;
    return;
  }
  const s = data.subjects[subject];
  const judged = isOpen() ? data.texts[data.judged[subject][i]] : "";
  $("r-judged").hidden = !judged;
  reveal($("r-judge"), judged || "");
  $("r-title").textContent = (isOpen() ? "Answer of " : "Reply of ") + s.model + " at " + s.condition;
  reveal($("r-text"), data.texts[data.replies[subject][i]] || "");
  const [sign, name, word] = mark(subject, i), lenient = isOpen() ? ABSENT : data.lenient[subject][i];
  $("r-mark").textContent = (sign ? sign + ", " : "") + word;
  $("r-mark").className = name;
  const said = (code) => code < UNREAD ? letter(code) : "nothing";
  const read = lenient < FAILED ? [`strict parsing: ${said(chosen(subject, i))}`, `lenient: ${said(lenient)}`] : [];
  $("r-reading").textContent = [...read, ...requestOf(subject, i)].join(" · ");
  const prompt = promptOf(subject, i);
  $("r-asked").hidden = !prompt;
  reveal($("r-prompt"), prompt || "");
};

// The prompt as it was sent, with the place of the images; empty if it is not known or nothing was sent.
const FILLED = /[\ue000-\ue01a]/g;
const promptOf = (subject, i) => {
  const { prompts, attempts } = data.requests ?? {};
  const { model, light } = data.subjects[subject];
  if (!prompts || !(model in prompts.models) || !attempts[subject][i]) return "";
  const item = data.items[i], isBlind = light === "blind";
  const texts = [data.questions[item.question].text, ...data.choices[item.choices]];
  const sent = prompts.forms[prompts.items[i][isBlind ? 1 : 0]].replace(FILLED, (mark) => texts[mark.charCodeAt(0) - 0xe000] ?? mark);
  if (!sent) return "";
  const images = isBlind ? [] : ["[the image]"];
  const message = prompts.image_first ? [...images, sent] : [sent, ...images];
  return [...(prompts.models[model] ? ["[system] " + prompts.models[model]] : []), ...message].join("\n\n");
};

// An amount in dollars with two digits, however small.
const dollars = (amount) => "$" + amount.toFixed(Math.min(9, Math.max(2, 1 - Math.floor(Math.log10(amount)))));

// The request behind a reply: its time, tokens and attempts, as far as they are known.
const requestOf = (subject, i) => {
  if (!data.requests) return [];
  const [latency, prompt, given, attempts] = ["latency", "prompt", "reply", "attempts"].map((name) => data.requests[name][subject][i]);
  const facts = [];
  if (latency) facts.push(`${latency} ms`);
  const tokens = [[prompt, "prompt"], [given, "reply"]].filter(([count]) => count).map(([count, kind]) => `${count} ${kind}`);
  if (tokens.length) facts.push(tokens.join(" and ") + " tokens");
  if (attempts > 1) facts.push(`${attempts} attempts`);
  const cost = data.requests.cost[subject]?.[i];
  if (cost) facts.push(dollars(cost / 1e9));
  return facts;
};

const draw = () => {
  if (state.item === null || !shown.length) {
    $("item").hidden = true;
    return;
  }
  $("item").hidden = false;
  const i = state.item, item = data.items[i], question = data.questions[item.question];
  const subject = subjectNow();
  reveal($("i-question"), question.text || question.id);
  $("i-id").textContent = item.name + (item.combination ? " · " + item.combination : "") + " · " + data.frames[question.frame] + " · " + data.families[question.family][1];
  $("i-link").href = link();
  if (hasActed) history.replaceState(null, "", link());
  const list = data.choices[item.choices].map((choice, index) => {
    const row = make("li");
    reveal(row, letter(index) + ". " + choice);
    if (index === reference(subject, i)) {
      row.classList.add(hasTruth() ? "true" : "before");
      row.title = hasTruth() ? "true" : "its answer at L0";
      row.append(hasTruth() ? " ✓" : " (at L0)");
    }
    if (subject >= 0 && chosen(subject, i) === index) { row.classList.add("chosen"); row.title = "chosen"; }
    return row;
  });
  if (isOpen()) {
    const right = [question.answer, ...(question.also_right || [])].filter((answer) => answer !== undefined);
    list.push(...right.map((answer, place) => {
      const row = make("li", undefined, "true");
      reveal(row, (place ? "also right: " : "right: ") + answer + " ✓");
      return row;
    }));
  }
  $("i-choices").replaceChildren(...list);
  pictures(question, item.draw);
  marks(i);
  unread(i);
  answers(i);
  reply(subject, i);
  $("i-evidence").textContent = question.evidence ? JSON.stringify(question.evidence, null, 1) : "none";
};

const confusion = () => {
  const all = data.confusions;
  $("confusion").hidden = !all.length;
  if (!all.length) return;
  const of = (c) => data.subjects[c.subject];
  const model = fill($("c-model"), unique(all.map((c) => of(c).model)), $("c-model").value);
  const conditions = unique(all.filter((c) => of(c).model === model).map((c) => of(c).condition));
  const condition = fill($("c-condition"), conditions, $("c-condition").value);
  const families = unique(all.filter((c) => of(c).model === model && of(c).condition === condition).map((c) => c.family));
  const family = fill($("c-family"), families, $("c-family").value, familyWords);
  const one = all.find((c) => of(c).model === model && of(c).condition === condition && c.family === family);
  const table = $("c-table"), head = make("tr");
  const columns = [hasTruth() ? "true ↓ given →" : "at L0 ↓ given →", ...one.labels, "not readable"];
  head.append(...columns.map((name) => { const th = make("th", name); th.scope = "col"; return th; }));
  const rows = one.counts.map((row, truth) => {
    const line = make("tr");
    const name = make("th", one.labels[truth]);
    name.scope = "row";
    line.append(name, ...row.map((n, given) => make("td", n || "·", n && given === truth ? "diagonal" : "")));
    return line;
  });
  table.replaceChildren(head, ...rows);
};

const said = () => {
  const parts = location.hash.slice(1).split("&").map((part) => part.split("="));
  const found = {};
  for (const [key, value] of parts) {
    try { if (value !== undefined) found[key] = decodeURIComponent(value); } catch { /* no link of ours */ }
  }
  return found;
};
const follow = () => {
  const link = said();
  if (!link.item && !link.model) return false;
  // A point of a chart names no item: the first one that is shown.
  const item = link.item ? data.items.findIndex((i) => i.name === link.item) : 0;
  if (item < 0) return false;
  acted();
  state = { family: link.family || "all", model: link.model, light: link.light, level: link.level, against: link.against || "–", show: link.show || "all", words: link.words || "", item, pictured: null };
  refresh();
  if (shown.includes(item)) go(item);
  return true;
};

const start = async () => {
  data = await unpack();
  findReferences();
  if (isOpen()) openStates(); else if (!hasTruth()) withoutTruth();
  $("i-evidenced").hidden = isOpen();
  $("i-key").textContent = isOpen()
    ? "Marks of the judge from 1 to 5 (0: no answer) · ? not marked · ! not answered; a click shows the answer and what the judge said"
    : `${hasTruth() ? "✓ right · ✗ wrong" : `= ${SAME} · ≠ ${OTHER}`} · ? not read · ! failed; the letter is the choice that was read; a click shows the reply`;
  // At first: the first model under test, raw images of the darkest level, and what it got wrong there.
  const first = data.subjects.find((s) => s.light !== "blind" && !s.reference) || data.subjects.find((s) => s.light !== "blind") || data.subjects[0];
  const order = (s) => everyLevel().indexOf(s.level);
  const raws = data.subjects.filter((s) => s.model === first?.model && s.level !== null && s.enhancer === null);
  const darkestOrder = Math.max(...raws.map(order));
  const lost = isOpen() ? "mark below 5" : hasTruth() ? "wrong" : OTHER;
  const isLost = (s) => data.items.some((_, i) => STATES[lost](data.subjects.indexOf(s), i));
  const candidates = raws.filter((s) => order(s) === darkestOrder);
  const darkest = candidates.find(isLost) ?? candidates[0];
  state = { family: "all", model: first?.model, light: darkest?.light, level: darkest?.level, against: "–", show: darkest && isLost(darkest) ? lost : "all", words: "", item: data.items.length ? 0 : null, pictured: null };
  $("loading").hidden = true;
  $("explorer").hidden = false;
  const set = (key, id) => $(id).addEventListener("change", (event) => { acted(); state[key] = event.target.value; state.pictured = null; refresh(key); });
  set("family", "f-family"); set("model", "f-model"); set("light", "f-light"); set("level", "f-level"); set("against", "f-against"); set("show", "f-state");
  $("f-words").addEventListener("input", (event) => { acted(); state.words = event.target.value; refresh(); });
  $("next").addEventListener("click", () => step(1));
  $("previous").addEventListener("click", () => step(-1));
  $("i-level").addEventListener("input", (event) => {
    const there = everyLevel();
    acted();
    state.pictured = there[Number(event.target.value)];
    if (find(state.model, state.light, state.pictured) >= 0) { state.level = state.pictured; refresh(); } else { draw(); }
  });
  const images = $("i-images");
  images.addEventListener("wheel", (event) => {
    const frame = event.target.closest(".frame");
    if (!frame || !(event.ctrlKey || view.zoom > 1 || event.deltaY < 0)) return;
    event.preventDefault();
    const rect = frame.getBoundingClientRect();
    zoom(event.deltaY < 0 ? 1.25 : 0.8, (event.clientX - rect.left) / rect.width, (event.clientY - rect.top) / rect.height);
  }, { passive: false });
  images.addEventListener("pointerdown", (event) => { if (event.target.closest(".frame")) images.setPointerCapture(event.pointerId); });
  images.addEventListener("pointermove", (event) => {
    const frame = images.querySelector(".frame");
    if (frame && images.hasPointerCapture(event.pointerId)) pan(-event.movementX / frame.clientWidth, -event.movementY / frame.clientHeight);
  });
  images.addEventListener("keydown", (event) => {
    const keys = { "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), ArrowLeft: () => pan(-0.1, 0), ArrowRight: () => pan(0.1, 0), ArrowUp: () => pan(0, -0.1), ArrowDown: () => pan(0, 0.1), "0": () => zoom(1 / MOST_ZOOM) };
    if (keys[event.key]) { keys[event.key](); event.preventDefault(); }
  });
  $("i-in").addEventListener("click", () => zoom(1.6));
  $("i-out").addEventListener("click", () => zoom(1 / 1.6));
  $("i-object").addEventListener("click", toTheObject);
  $("i-boxes").addEventListener("change", () => { if (state.item !== null) draw(); });
  new ResizeObserver(show).observe(images);
  for (const id of ["c-model", "c-condition", "c-family"]) $(id)?.addEventListener("change", confusion);
  if ($("confusion")) confusion();
  // The page opens at its top, unless the address names an item; showing the first item writes its name there.
  const linked = data.subjects.length && follow();
  if (data.subjects.length && !linked) refresh();
  if (linked) { $("items").scrollIntoView(); }
  addEventListener("hashchange", () => { if (location.hash !== link() && follow()) { $("items").scrollIntoView(); } });
  document.documentElement.dataset.ready = "true";
};

addEventListener("keydown", (event) => {
  if (event.target.matches("input:not([type=range]), select, textarea") || event.ctrlKey || event.metaKey || event.altKey || !data) return;
  const slide = (by) => { const s = $("i-level"); s.value = Number(s.value) + by; s.dispatchEvent(new Event("input")); };
  const keys = { j: () => step(1), k: () => step(-1), "]": () => slide(1), "[": () => slide(-1), t: theme };
  if (event.target.id === "list") Object.assign(keys, { ArrowDown: keys.j, ArrowUp: keys.k });
  if (keys[event.key]) { keys[event.key](); event.preventDefault(); }
});

start().catch((error) => { $("loading").textContent = "The items cannot be shown here: " + error.message; throw error; });
