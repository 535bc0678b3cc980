// The images of the item at a level, side by side in one view: all zoom and move together.
const view = { zoom: 1, x: 0, y: 0 };
const MOST_ZOOM = 16;
const show = () => {
  view.zoom = Math.min(Math.max(view.zoom, 1), MOST_ZOOM);
  const most = 1 - 1 / view.zoom;
  view.x = Math.min(Math.max(view.x, 0), most);
  view.y = Math.min(Math.max(view.y, 0), most);
  for (const frame of $("i-images").querySelectorAll(".frame")) {
    const { clientWidth: width, clientHeight: height } = frame;
    frame.querySelector(".whole").style.transform = `scale(${view.zoom}) translate(${-view.x * width}px, ${-view.y * height}px)`;
    for (const box of frame.querySelectorAll(".box")) {
      const [left, top, right, bottom] = box.dataset.at.split(" ").map(Number);
      Object.assign(box.style, {
        left: (left - view.x) * view.zoom * width + "px", top: (top - view.y) * view.zoom * height + "px",
        width: (right - left) * view.zoom * width + "px", height: (bottom - top) * view.zoom * height + "px",
      });
    }
  }
  $("i-zoom").textContent = view.zoom.toFixed(1).replace(".0", "") + " ×";
};
const zoom = (factor, x = 0.5, y = 0.5) => {
  const before = view.zoom;
  view.zoom = Math.min(Math.max(view.zoom * factor, 1), MOST_ZOOM);
  view.x += x / before - x / view.zoom;
  view.y += y / before - y / view.zoom;
  show();
};
const pan = (x, y) => { view.x += x / view.zoom; view.y += y / view.zoom; show(); };

// The boxes of the things that a question is about, as shares of the sides of its frame; none for a question about the whole room.
const boxes = (question) => {
  const size = data.sizes[question.frame];
  if (!size) return [];
  return question.outlines.map(([left, top, right, bottom]) => [left / size[0], top / size[1], right / size[0], bottom / size[1]]);
};
const toTheObject = () => {
  const all = boxes(data.questions[data.items[state.item].question]);
  if (!all.length) return;
  const least = (at) => Math.min(...all.map((box) => box[at])), most = (at) => Math.max(...all.map((box) => box[at]));
  const [left, top, right, bottom] = [least(0), least(1), most(2), most(3)];
  view.zoom = 0.8 / Math.max(right - left, bottom - top, 0.05);
  view.zoom = Math.min(Math.max(view.zoom, 1), MOST_ZOOM);
  view.x = (left + right) / 2 - 0.5 / view.zoom;
  view.y = (top + bottom) / 2 - 0.5 / view.zoom;
  show();
};

// The name of a condition in a draw of the noise, as L5-noise~1+zerodce; itself if its noise is not drawn.
const inDraw = (kept, condition, draw) => {
  const [light, ...enhancer] = condition.split("+");
  const hasDraws = Object.keys(kept).some((name) => name.startsWith(light + "~"));
  return hasDraws && draw ? [light + "~" + draw, ...enhancer].join("+") : condition;
};

const pictures = (question, draw = 0) => {
  const kept = data.thumbnails[question.frame], box = $("i-images");
  box.replaceChildren();
  const there = everyLevel();
  const slider = $("i-level");
  slider.max = Math.max(there.length - 1, 0);
  const level = state.pictured && there.includes(state.pictured) ? state.pictured : (state.level || there[0]);
  slider.value = Math.max(there.indexOf(level), 0);
  $("i-level-name").textContent = level ? level + " (" + severity(level) + ")" : "";
  $("i-pictures").hidden = !kept;
  const remake = "darkqa-eval show " + data.folders[0] + " " + question.id;
  $("i-remake").textContent = (kept ? "Small copies. " : "No small copy of this frame is stored. ") + "The images as they were sent, proved by digest: " + remake;
  if (!kept) return;
  const outlines = boxes(question);
  $("i-object").hidden = !outlines.length;
  $("i-boxes").parentElement.hidden = !outlines.length;
  const conditions = unique(data.subjects.filter((s) => s.level === level).map((s) => s.condition));
  for (const condition of level === "L0" ? conditions : ["L0", ...conditions]) {
    const name = inDraw(kept, condition, draw), image = kept[name];
    if (!image) continue;
    const figure = make("figure"), frame = make("div", undefined, "frame"), whole = make("img", undefined, "whole"), crop = make("img", undefined, "crop");
    whole.src = image.small;
    whole.draggable = false;
    // Of a walk, small copies of all frames, or of many the one in the middle.
    const walk = isOpen() ? ", frames of the walk (of many, that in the middle)" : "";
    whole.alt = name + " of " + data.frames[question.frame] + walk;
    frame.append(whole);
    for (const at of $("i-boxes").checked ? outlines : []) {
      const outline = make("span", undefined, "box");
      outline.dataset.at = at.join(" ");
      frame.append(outline);
    }
    whole.addEventListener("load", show);
    const object = question.object && image.objects.find((one) => one.object.join() === question.object.join());
    crop.src = object ? object.crop : image.crop;
    const part = object ? "the thing asked about" : isOpen() ? "the middle of the middle one" : "its middle";
    crop.alt = part + ", " + whole.alt;
    const gain = image.stops > 0 ? "light × " + Math.round(2 ** image.stops) + " (" + image.stops + " EV)" : "as it is";
    figure.append(frame, crop, make("figcaption", name + walk + "; below, " + part + ", " + gain));
    box.append(figure);
  }
  show();
};
