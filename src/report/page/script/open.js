// What is of open questions alone.

// Open questions have marks of a judge where others have choices: 1 to 5, and 0 of an answer that says nothing.
const BEST_MARK = 5;
const isOpen = () => data.kind === "open";

const openMark = (code) => {
  if (code === BEST_MARK) return ["✓ 5/5", "m-right", "mark 5 of 5"];
  if (code === 0) return ["✗ 0", "m-wrong", "no answer in the reply, which scores 0"];
  return code === 1 ? ["✗ 1/5", "m-wrong", "mark 1 of 5, which scores 0"] : [code + "/5", "m-none", `mark ${code} of 5`];
};

// The filters: marks are higher or lower.
const openStates = () => {
  // 0 and 1 both score nothing.
  const points = (s, i) => s >= 0 && chosen(s, i) < UNREAD ? Math.max(chosen(s, i), 1) : null;
  const less = (a, b) => a !== null && b !== null && a < b;
  const cleanOf = (s) => data.subjects[s].clean ?? -1;
  const rawOf = (s) => raw(s) === s ? -1 : raw(s);
  const states = {
    "all": () => true,
    "mark 5": (s, i) => chosen(s, i) === BEST_MARK,
    "mark below 5": (s, i) => chosen(s, i) < BEST_MARK,
    "not marked": (s, i) => chosen(s, i) === UNREAD,
    "not answered": (s, i) => chosen(s, i) === FAILED,
    "lower than at L0": (s, i) => less(points(s, i), points(cleanOf(s), i)),
    "higher than at L0": (s, i) => less(points(cleanOf(s), i), points(s, i)),
    "lower than at L0 for any model": (_, i) => data.subjects.some((_o, s) => less(points(s, i), points(cleanOf(s), i))),
    "higher with the enhancer": (s, i) => less(points(rawOf(s), i), points(s, i)),
    "lower with the enhancer": (s, i) => less(points(s, i), points(rawOf(s), i)),
    "higher here than there": (s, i) => less(points(there(), i), points(s, i)),
    "lower here than there": (s, i) => less(points(s, i), points(there(), i)),
    "models differ": STATES["models differ"],
  };
  for (const name of Object.keys(STATES)) delete STATES[name];
  Object.assign(STATES, states);
};

// All answers to an open question, with their marks and what the judge said.
const answers = (i) => {
  const box = $("i-answers");
  box.hidden = !isOpen();
  if (!isOpen()) return;
  const table = make("table"), head = make("tr"), thead = make("thead"), body = make("tbody");
  const names = shortened(unique(data.subjects.map((s) => s.model)));
  head.append(...["model", "shown", "mark", "answer"].map((name) => { const th = make("th", name, name === "mark" ? "" : "text"); th.scope = "col"; return th; }));
  thead.append(head);
  data.subjects.forEach((s, subject) => {
    if (chosen(subject, i) === ABSENT) return;
    const [sign, name, word] = mark(subject, i), row = make("tr"), first = make("th", names.get(s.model)), said = make("td", undefined, "said");
    first.scope = "row";
    first.title = s.model;
    reveal(said, data.texts[data.replies[subject][i]] || word);
    const marked = make("td", sign, name);
    marked.title = word;
    row.append(first, make("td", s.condition, "text"), marked, said);
    body.append(row);
  });
  table.append(make("caption", "All answers"), thead, body);
  box.replaceChildren(table);
};
