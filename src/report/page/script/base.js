"use strict";
document.documentElement.classList.add("scripted");

const $ = (id) => document.getElementById(id);
const make = (tag, text, className) => {
  const element = document.createElement(tag);
  if (text !== undefined) element.textContent = text;
  if (className) element.className = className;
  return element;
};
const unique = (values) => [...new Set(values)];

// Theme: the system's until a person chooses; the choice is kept where the browser allows it.
const KEPT_THEME = "darkqa-eval theme";
try {
  const kept = localStorage.getItem(KEPT_THEME);
  if (kept === "dark" || kept === "light") document.documentElement.dataset.theme = kept;
} catch { /* A private window keeps nothing. */ }
const theme = () => {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
  const now = root.dataset.theme || system;
  root.dataset.theme = now === "dark" ? "light" : "dark";
  try { localStorage.setItem(KEPT_THEME, root.dataset.theme); } catch { /* As above. */ }
};
$("theme").addEventListener("click", theme);

// The navigation stays at the top of the window: links lead to just below it.
const nav = document.querySelector("nav");
if (nav) new ResizeObserver(() => { document.documentElement.style.scrollPaddingTop = nav.offsetHeight + 12 + "px"; }).observe(nav);

// The shortest form of a name: without "script:", folders and the ending; long ones keep both ends. Names that would be alike stay whole.
const MOST_LETTERS = 22;
const shortened = (names) => {
  const short = (name) => {
    const bare = name.replace(/^script:/, "").replace(/^.*\/(?=[^/])/, "").replace(/\.jsonl?$/, "");
    if (bare.length <= MOST_LETTERS) return bare;
    const half = Math.floor((MOST_LETTERS - 1) / 2);
    return bare.slice(0, half) + "…" + bare.slice(-half);
  };
  const all = new Map(names.map((name) => [name, short(name)]));
  const counts = new Map();
  for (const name of all.values()) counts.set(name, (counts.get(name) || 0) + 1);
  return new Map([...all].map(([name, form]) => [name, counts.get(form) > 1 ? name : form]));
};
