"use strict";
// The page that teaches a job: a box drawn on the picture and four numbers say the same; the format follows the text.
(() => {
  const svg = document.getElementById("drawn-on");
  const sides = ["left", "top", "right", "bottom"].map((side) => document.getElementById(side));
  const text = document.getElementById("text"), format = document.getElementById("format");
  if (!svg) return;
  const { width, height } = svg.viewBox.baseVal;
  const whole = [width, height, width, height];
  let from = null;

  // ---- the box
  function show() {
    const [left, top, right, bottom] = sides.map((field, k) => (Number(field.value) / 100) * whole[k]);
    for (const rect of svg.querySelectorAll(".region")) {
      rect.setAttribute("x", left);
      rect.setAttribute("y", top);
      rect.setAttribute("width", Math.max(0, right - left));
      rect.setAttribute("height", Math.max(0, bottom - top));
    }
  }

  function at(event) {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return [Math.min(width, Math.max(0, point.x)), Math.min(height, Math.max(0, point.y))];
  }

  svg.addEventListener("pointerdown", (event) => {
    if (event.button) return;
    event.preventDefault();
    from = at(event);
    svg.setPointerCapture(event.pointerId);
  });
  svg.addEventListener("pointermove", (event) => {
    if (!from) return;
    const to = at(event);
    if (Math.abs(to[0] - from[0]) < 3 || Math.abs(to[1] - from[1]) < 3) return; // a click draws no box
    const ends = [Math.min(from[0], to[0]), Math.min(from[1], to[1]), Math.max(from[0], to[0]), Math.max(from[1], to[1])];
    sides.forEach((field, k) => { field.value = ((100 * ends[k]) / whole[k]).toFixed(1); });
    show();
  });
  for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => { from = null; });
  for (const field of sides) field.addEventListener("input", show);
  show();

  // ---- the format, until a person has typed one
  let own = false;
  format.addEventListener("input", () => { own = format.value !== ""; });
  text.addEventListener("input", async () => {
    if (own) return;
    const asked = text.value;
    try {
      const answer = await fetch(`${document.getElementById("teach").dataset.format}?text=${encodeURIComponent(asked)}`);
      if (answer.ok && !own && text.value === asked) format.value = await answer.text();
    } catch {
      if (!own) format.value = ""; // the service proposes one when the job is saved
    }
  });
})();
