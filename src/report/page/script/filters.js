// The filters of the items: what each shows, and which of their combinations have items.

// What the selected subject is held against, where something is.
const there = () => data.subjects.findIndex((s) => s.name === state.against);
const both = (s, i) => there() >= 0 && chosen(s, i) < FAILED && chosen(there(), i) < FAILED;

// Right at L0 and at every level before this one, and wrong here.
const isFirstLost = (s, i) => {
  const here = data.subjects[s];
  if (here.level === null || here.level === "L0" || chosen(s, i) >= FAILED || isRight(s, i)) return false;
  const before = everyLevel().slice(0, everyLevel().indexOf(here.level));
  const earlier = before.map((level) => at(here.model, here.light, level)).filter((subject) => subject >= 0);
  return earlier.length > 0 && earlier.every((subject) => isRight(subject, i));
};

const STATES = {
  "all": () => true,
  "right": (s, i) => isRight(s, i),
  "wrong": (s, i) => chosen(s, i) < UNREAD && !isRight(s, i),
  "not read": (s, i) => chosen(s, i) === UNREAD,
  "failed": (s, i) => chosen(s, i) === FAILED,
  "lost since L0": (s, i) => { const l = data.subjects[s].clean ?? -1; return l >= 0 && isRight(l, i) && chosen(s, i) < FAILED && !isRight(s, i); },
  "found since L0": (s, i) => { const l = data.subjects[s].clean ?? -1; return l >= 0 && chosen(l, i) < FAILED && !isRight(l, i) && isRight(s, i); },
  "first lost at this level": (s, i) => isFirstLost(s, i),
  "rescued by the enhancer": (s, i) => { const r = raw(s); return r >= 0 && r !== s && chosen(r, i) < FAILED && !isRight(r, i) && isRight(s, i); },
  "harmed by the enhancer": (s, i) => { const r = raw(s); return r >= 0 && r !== s && isRight(r, i) && chosen(s, i) < FAILED && !isRight(s, i); },
  "right here, wrong there": (s, i) => isRight(s, i) && both(s, i) && !isRight(there(), i),
  "wrong here, right there": (s, i) => both(s, i) && !isRight(s, i) && isRight(there(), i),
  "another answer there": (s, i) => both(s, i) && chosen(s, i) !== chosen(there(), i),
  "models differ": (s, i) => {
    const here = data.subjects[s];
    const codes = data.subjects.map((o, n) => o.level === here.level && o.light === here.light ? chosen(n, i) : ABSENT).filter((c) => c < FAILED);
    return new Set(codes).size > 1;
  },
};

// The same without true choices: nothing is right or wrong.
const SAME = "as at L0", OTHER = "not as at L0";
const withoutTruth = () => {
  const kept = [["all", "all"], ["right", SAME], ["wrong", OTHER], ["not read", "not read"], ["failed", "failed"],
    ["rescued by the enhancer", "brought back by the enhancer"], ["harmed by the enhancer", "changed by the enhancer"],
    ["another answer there", "another answer there"], ["models differ", "models differ"]];
  const states = kept.map(([name, own]) => [own, STATES[name]]);
  for (const name of Object.keys(STATES)) delete STATES[name];
  Object.assign(STATES, Object.fromEntries(states));
};

// Fills a select box with values, of which a reader sees the words.
const fill = (select, values, value, wordsOf = (v) => v) => {
  select.replaceChildren(...values.map((v) => { const o = make("option", wordsOf(v)); o.value = v; return o; }));
  select.value = values.includes(value) ? value : values[0];
  return select.value;
};

const familyWords = (name) => data.families.find(([own]) => own === name)?.[1] ?? name;
const everyLevel = () => data.levels.map(([name]) => name);
const severity = (level) => data.levels.find(([name]) => name === level)[1];
const lights = (model) => unique(data.subjects.filter((s) => s.model === model).map((s) => s.light));
// The levels at which a model was asked in some light, by darkness.
const levels = (model, inLight) => {
  const asked = data.subjects.filter((s) => s.model === model && inLight(s.light)).map((s) => s.level);
  return everyLevel().filter((level) => asked.includes(level));
};

const subjectNow = () => find(state.model, state.light, state.light === "blind" ? null : state.level);

// Whether a selection has items.
const hasItems = (wanted) => {
  const now = state;
  state = wanted;
  const subject = subjectNow(), found = data.items.some((_, i) => passes(subject, i));
  state = now;
  return found;
};

// A selection that some model was asked in. Not each light has each level: the one that was not just chosen follows the
// other, to a light with items if there is one.
const followed = (wanted, changed) => {
  const next = { ...wanted }, own = lights(next.model);
  const within = (light) => levels(next.model, (other) => other === light);
  if (next.against === "–" && next.show.endsWith(" there")) next.show = "all";
  if (!own.includes(next.light)) next.light = own[0];
  if (next.light === "blind") next.level = null;
  else if (!within(next.light).includes(next.level)) {
    const others = changed === "light" ? [] : own.filter((light) => within(light).includes(next.level));
    if (others.length) next.light = others.find((light) => hasItems({ ...next, light })) ?? others[0];
    else next.level = within(next.light).at(-1);
  }
  return next;
};

// The questions and replies with the words that were searched last.
let searched = { words: "" };
const search = (text) => {
  const words = text.toLowerCase(), has = (t) => t.toLowerCase().includes(words);
  if (searched.words !== words) {
    const questions = data.questions.map((q) => [q.text, q.id, data.frames[q.frame], q.answer || ""].some(has));
    searched = { words, texts: data.texts.map(has), questions };
  }
  return searched;
};

// Whether an item passes the filters.
const passes = (subject, i) => {
  const item = data.items[i];
  if (state.family !== "all" && data.families[data.questions[item.question].family][0] !== state.family) return false;
  if (subject < 0 || chosen(subject, i) === ABSENT || !(STATES[state.show] ?? STATES.all)(subject, i)) return false;
  if (!state.words) return true;
  const { texts, questions } = search(state.words);
  return questions[item.question] || (isOpen() ? data.replies.some((row) => texts[row[i]]) : texts[data.replies[subject][i]]);
};

// Disables the options with which no item would be shown under the other filters, and counts them as 0.
const disableEmpty = (select, key) => {
  for (const option of select.options) {
    const isEmpty = !hasItems(followed({ ...state, [key]: option.value }, key));
    option.disabled = isEmpty && option.value !== select.value;
    if (isEmpty) option.textContent += " (0)";
  }
};

// Fills the select boxes.
const choices = (changed) => {
  state.family = fill($("f-family"), ["all", ...data.families.map(([name]) => name)], state.family, familyWords);
  state.model = fill($("f-model"), unique(data.subjects.map((s) => s.model)), state.model);
  state.against = fill($("f-against"), ["–", ...data.subjects.map((s) => s.name)], state.against);
  state = followed(state, changed);
  fill($("f-light"), lights(state.model), state.light);
  if (state.light === "blind") fill($("f-level"), ["–"]); else fill($("f-level"), levels(state.model, () => true), state.level);
  const states = Object.keys(STATES).filter((name) => state.against !== "–" || !name.endsWith(" there"));
  state.show = fill($("f-state"), states, state.show);
  $("f-words").value = state.words;
  const boxes = { family: "f-family", model: "f-model", light: "f-light", level: "f-level", against: "f-against", show: "f-state" };
  for (const [key, id] of Object.entries(boxes)) disableEmpty($(id), key);
};

const select = () => {
  const subject = subjectNow();
  shown = data.items.map((_, i) => i).filter((i) => passes(subject, i));
  $("f-count").textContent = shown.length + " of " + data.items.length + " items";
};
