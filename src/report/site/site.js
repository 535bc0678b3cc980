
// Sorting: a button in each head of a column. Rows without a value stay last, whichever way.
const value = (row, column) => row.cells[column].dataset.key;
const sortBy = (table, column) => {
  const heads = [...table.tHead.rows[0].cells];
  const head = heads[column];
  const now = head.getAttribute("aria-sort") === "ascending" ? "descending" : "ascending";
  for (const other of heads) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", now);
  const rows = [...table.tBodies[0].rows];
  const keys = rows.map((row) => value(row, column)).filter((key) => key !== "");
  const areNumbers = keys.every((key) => Number.isFinite(Number(key)));
  const compare = areNumbers ? (a, b) => Number(a) - Number(b) : (a, b) => a.localeCompare(b, "en");
  const sign = now === "ascending" ? 1 : -1;
  rows.sort((a, b) => {
    const [first, second] = [value(a, column), value(b, column)];
    if (first === "" || second === "") return (first === "") - (second === "");
    return sign * compare(first, second);
  });
  table.tBodies[0].append(...rows);
};
for (const table of document.querySelectorAll("table.board")) {
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const button = make("button", head.textContent);
    button.type = "button";
    button.addEventListener("click", () => sortBy(table, column));
    head.replaceChildren(button);
  });
}

// The filter: rows whose model or run has the letters.
const filter = () => {
  const letters = $("filter").value.trim().toLowerCase();
  const rows = [...document.querySelectorAll("table.board tbody tr")];
  let shown = 0;
  for (const row of rows) {
    row.hidden = !row.dataset.words.includes(letters);
    shown += row.hidden ? 0 : 1;
  }
  $("found").textContent = letters ? `${shown} of ${rows.length} rows` : "";
};
$("filter").addEventListener("input", filter);
filter();

// The chooser of columns: a box for each head, but that of the models. A column that is off is off in all tables.
const heads = new Map();
for (const table of document.querySelectorAll("table.board")) {
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const name = head.textContent;
    if (name === "model") return;
    heads.set(name, [...(heads.get(name) ?? []), ...[...table.rows].map((row) => row.cells[column])]);
  });
}
for (const [name, cells] of heads) {
  const label = make("label"), box = make("input");
  Object.assign(box, { type: "checkbox", checked: true });
  box.addEventListener("change", () => cells.forEach((cell) => { cell.hidden = !box.checked; }));
  label.append(box, " " + name);
  $("columns").append(label, " ");
}
