"use strict";
// Every page: times of day as on this machine's clock, pictures that fail said in words, lists that keep themselves fresh.
(() => {
  const pad = (n) => String(n).padStart(2, "0");
  const styles = {
    full: (d) => `${d.getFullYear()}-${pad(d.getMonth() + 1)}-${pad(d.getDate())} ${pad(d.getHours())}:${pad(d.getMinutes())}:${pad(d.getSeconds())}`,
    date: (d) => `${pad(d.getMonth() + 1)}-${pad(d.getDate())}`,
    hour: (d) => `${pad(d.getHours())}:${pad(d.getMinutes())}`,
  };

  function tellTimes(root) {
    for (const node of root.querySelectorAll("time[datetime], [data-time]")) {
      const at = new Date(node.getAttribute("datetime") || node.dataset.time);
      if (Number.isNaN(at.getTime())) continue;
      if (node.localName === "time") node.title = node.getAttribute("datetime");
      node.textContent = styles[node.dataset.style || "full"](at);
    }
  }

  function minePictures(root) {
    for (const figure of root.querySelectorAll(".picture")) {
      const picture = figure.querySelector("image, img");
      const failed = () => {
        if (!picture.isConnected) return; // told already: the browser and the question below both tell
        figure.querySelector(".failed").hidden = false;
        figure.querySelector("svg, img").remove();
        for (const extra of figure.querySelectorAll("figcaption a, .zoom")) extra.remove();
      };
      if (!picture) continue;
      picture.addEventListener("error", failed);
      if (picture.localName === "image") {
        // an SVG image that failed before this script ran tells nobody; asking again does
        const again = new Image();
        again.addEventListener("error", failed);
        again.src = picture.getAttribute("href");
      } else if (picture.complete && !picture.naturalWidth) failed();
      const zoom = figure.querySelector("[data-zoom]");
      if (!zoom) continue;
      zoom.hidden = false;
      zoom.addEventListener("click", () => {
        const svg = figure.querySelector("svg");
        const whole = svg.getAttribute("viewBox") !== svg.dataset.whole;
        svg.setAttribute("viewBox", whole ? svg.dataset.whole : svg.dataset.line);
        zoom.textContent = whole ? "Line only" : "Whole picture";
      });
    }
  }

  async function refresh(live) {
    if (document.hidden) return;
    let text;
    try {
      const answer = await fetch(location.pathname + location.search.replace(/([?&])done=[^&]*/, "$1"), { headers: { Accept: "text/html" } });
      if (!answer.ok || answer.redirected) return;
      text = await answer.text();
    } catch {
      return; // the service is away for a moment; the next turn tells
    }
    const page = new DOMParser().parseFromString(text, "text/html");
    const fresh = page.getElementById("live");
    if (!fresh) return;
    tellTimes(fresh);
    if (fresh.innerHTML === live.innerHTML) return;
    const focused = live.contains(document.activeElement) ? document.activeElement.getAttribute("href") : null;
    live.replaceChildren(...fresh.childNodes);
    const count = page.getElementById("waiting"), shown = document.getElementById("waiting");
    if (count && shown) { shown.textContent = count.textContent; shown.className = count.className; }
    if (focused) [...live.querySelectorAll("a")].find((a) => a.getAttribute("href") === focused)?.focus();
  }

  tellTimes(document);
  minePictures(document);
  const live = document.getElementById("live");
  if (live && live.dataset.refreshS) {
    live.setAttribute("aria-live", "polite");
    setInterval(() => refresh(live), 1000 * Number(live.dataset.refreshS));
  }

  // Enter in the queue begins with the oldest; not the Enter still held down from the part before
  const opened = performance.now();
  document.addEventListener("keydown", (event) => {
    const first = document.querySelector("[data-first]");
    if (!first || event.key !== "Enter" || event.repeat || performance.now() - opened < 300) return;
    if (document.activeElement && document.activeElement !== document.body) return;
    event.preventDefault();
    first.click();
  });
})();
