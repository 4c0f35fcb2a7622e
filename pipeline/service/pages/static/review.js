"use strict";
// The page of one part: the chosen place is one character selected in the input, so typing replaces it.
//
//   text   K X 4 0 7        owners[k]: place of the reading that character k answers to, or null
//          ^ at             chosen together: cell, card of candidates, boxes on both pictures
(() => {
  const form = document.getElementById("review");
  const input = document.getElementById("text");
  const who = document.getElementById("who");
  if (!form || !input || input.readOnly) return;
  const cells = form.querySelector(".cells");
  const list = form.querySelector(".places");
  const main = form.querySelector(".button.main");
  const verb = document.getElementById("verb");
  const before = form.elements.before.value;
  const upper = form.dataset.upper === "1";
  const places = new Map();
  const opened = performance.now();
  const SETTLE_MS = 300; // an Enter meant for the part before must not fall on this one
  const HOLD_MS = 60000; // well within the time that a claim lasts
  const SIZES = [12, 20, 30, 40];
  let overtype = true;
  let at = 0;
  let text = input.value;
  let sent = false;

  for (const node of document.querySelectorAll("[data-place]")) {
    if (cells.contains(node)) continue;
    const place = Number(node.dataset.place);
    places.set(place, [...(places.get(place) || []), node]);
  }
  let owners = [...cells.children].map((c) => (c.dataset.place === undefined ? null : Number(c.dataset.place)));
  let doubts = [...cells.children].map((c) => c.className);
  const asRead = text === before ? { owners: [...owners], doubts: [...doubts] } : null;
  const cardOf = (place) => (places.get(place) || []).find((n) => n.classList.contains("place"));
  const charOf = (place) => cardOf(place)?.querySelector(".char").textContent;

  // ---- showing
  function drawCells() {
    while (cells.children.length > text.length) cells.lastChild.remove();
    while (cells.children.length < text.length) cells.append(document.createElement("span"));
    [...cells.children].forEach((cell, k) => {
      const own = owners[k];
      const edited = text !== before && (own === null ? text[k] !== " " : charOf(own) !== text[k]);
      cell.className = edited ? "edited" : doubts[k] || "";
      cell.classList.toggle("chosen", k === at);
    });
    const size = SIZES.find((s) => text.length <= s) || 0;
    cells.parentElement.className = `field size-${size}`;
    cells.scrollLeft = input.scrollLeft;
    verb.textContent = !before ? "Save" : text.trim() === before ? "Confirm" : "Save correction";
    main.classList.toggle("correct", Boolean(before) && text.trim() !== before);
    for (const button of form.querySelectorAll(".candidate.taken")) button.classList.remove("taken");
    owners.forEach((own, k) => {
      if (own === null) return;
      const taken = [...(cardOf(own)?.querySelectorAll(".candidate") || [])].find((b) => b.dataset.char === text[k]);
      if (taken) taken.classList.add("taken");
    });
  }

  function light(name, place) {
    for (const node of document.querySelectorAll(`.${name}[data-place]`)) node.classList.remove(name);
    for (const node of place === null ? [] : places.get(place) || []) node.classList.add(name);
    if (name === "hover") [...cells.children].forEach((c, k) => c.classList.toggle("hover", place !== null && owners[k] === place));
  }

  function show() {
    drawCells();
    const place = owners[at] === undefined ? null : owners[at];
    light("chosen", place);
    const card = place === null ? null : cardOf(place);
    if (card && list.scrollHeight > list.clientHeight) {
      const top = card.offsetTop - list.offsetTop;
      if (top < list.scrollTop) list.scrollTop = top - 4;
      else if (top + card.offsetHeight > list.scrollTop + list.clientHeight) list.scrollTop = top + card.offsetHeight - list.clientHeight + 4;
    }
  }

  function choose(k, focus = true) {
    at = Math.max(0, Math.min(k, text.length));
    if (focus && document.activeElement !== input) input.focus({ preventScroll: true });
    const end = overtype && at < text.length ? at + 1 : at;
    if (document.activeElement === input && (input.selectionStart !== at || input.selectionEnd !== end)) input.setSelectionRange(at, end);
    show();
  }

  // ---- changing: what stays in front and behind keeps its places
  function take(now) {
    let front = 0;
    while (front < Math.min(text.length, now.length) && text[front] === now[front]) front++;
    let back = 0;
    while (back < Math.min(text.length, now.length) - front && text[text.length - 1 - back] === now[now.length - 1 - back]) back++;
    const old = text.length - front - back, made = now.length - front - back;
    const keep = (values, none) => [
      ...values.slice(0, front),
      ...Array.from({ length: made }, (_, k) => (old === made ? values[front + k] : none)),
      ...values.slice(values.length - back, values.length),
    ];
    const tail = (values, none) => (back ? keep(values, none) : keep(values, none).slice(0, front + made));
    owners = tail(owners, null);
    doubts = tail(doubts, "");
    text = now;
    if (input.value !== now) input.value = now;
  }

  function put(char, k = at) {
    if (k > text.length) return;
    take(text.slice(0, k) + char + text.slice(k + 1));
  }

  function pick(place, n) {
    const k = owners.indexOf(place);
    const button = cardOf(place)?.querySelectorAll(".candidate")[n];
    if (k < 0 || !button) return false;
    put(button.dataset.char, k);
    choose(k);
    return true;
  }

  function turn(by) {
    const place = owners[at];
    const card = place === null || place === undefined ? null : cardOf(place);
    const chars = card ? [...card.querySelectorAll(".candidate")].map((b) => b.dataset.char) : [];
    if (!chars.length) return;
    const now = chars.indexOf(text[at]);
    put(chars[now < 0 ? 0 : (now + by + chars.length) % chars.length]);
    choose(at);
  }

  function send(button) {
    if (sent || performance.now() - opened < SETTLE_MS) return;
    if (!who.value.trim()) { who.focus(); who.reportValidity(); return; }
    form.requestSubmit(button);
  }

  // ---- keys
  input.addEventListener("input", () => {
    const caret = input.selectionStart;
    const now = upper ? input.value.toUpperCase() : input.value;
    take(now.length === input.value.length ? now : input.value);
    choose(caret);
  });

  // what is pasted is the whole serial: the one character selected is the page's choice, not the person's
  input.addEventListener("paste", (event) => {
    const given = (event.clipboardData?.getData("text") || "").replace(/\s+/g, " ").trim();
    const stretch = input.selectionEnd - input.selectionStart > 1;
    if (stretch || !overtype || [...given].length < 2) return; // into a stretch, between characters, one for one
    event.preventDefault();
    const now = upper ? given.toUpperCase() : given;
    take((now.length === given.length ? now : given).slice(0, input.maxLength));
    choose(text.length);
  });

  input.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.isComposing) return;
    if (event.shiftKey && event.key.startsWith("Arrow")) return; // a stretch of text, as anywhere
    const stretch = input.selectionEnd - input.selectionStart > 1;
    const keys = {
      ArrowLeft: () => choose(at - 1),
      ArrowRight: () => choose(at + 1),
      ArrowUp: () => turn(-1),
      ArrowDown: () => turn(1),
      Home: () => choose(0),
      End: () => choose(text.length),
      Insert: () => {
        overtype = !overtype;
        document.getElementById("mode").textContent = overtype ? "inserts instead" : "overtypes again";
        choose(at);
      },
      Escape: () => {
        take(before);
        if (asRead) { owners = [...asRead.owners]; doubts = [...asRead.doubts]; }
        choose(Math.min(at, text.length));
      },
    };
    if (event.key === "Backspace" && overtype && !stretch) {
      event.preventDefault(); // what stands before the place, as a caret there would
      if (at > 0) { take(text.slice(0, at - 1) + text.slice(at)); choose(at - 1); }
    } else if (keys[event.key]) {
      event.preventDefault();
      keys[event.key]();
    }
  });

  document.addEventListener("keydown", (event) => {
    const field = event.target.closest?.("input");
    if (event.key === "Enter" && !event.altKey && (!event.target.closest?.("a, button, input") || field)) {
      event.preventDefault();
      if (event.repeat) return; // held down: every part asks for a press of its own
      if (field === who && who.value.trim()) choose(first());
      else send(main);
      return;
    }
    if (!event.altKey || event.ctrlKey || event.metaKey) return;
    const digit = /^(?:Digit|Numpad)([1-5])$/.exec(event.code);
    const place = owners[at];
    if (digit) {
      event.preventDefault();
      if (place !== null && place !== undefined) pick(place, Number(digit[1]) - 1);
    } else if (event.repeat) return;
    else if (event.code === "KeyU") { event.preventDefault(); send(document.getElementById("unreadable")); }
    else if (event.code === "KeyN") { event.preventDefault(); location.assign(form.dataset.next); }
    else if (event.code === "KeyZ") { event.preventDefault(); document.querySelectorAll("[data-zoom]").forEach((b) => b.click()); }
  });

  form.addEventListener("submit", (event) => {
    if (sent) { event.preventDefault(); return; }
    sent = true;
    for (const button of form.querySelectorAll(".buttons .button")) button.classList.add("sent");
  });
  window.addEventListener("pageshow", () => { sent = false; });

  // ---- the part is this person's while the page is open and in sight
  const taken = document.getElementById("taken");
  const words = document.getElementById("taken-words");
  const tell = (more) => new URLSearchParams({ who: who.value, ...more });
  async function hold() {
    if (!form.dataset.claim || document.hidden) return;
    try {
      const answer = await fetch(form.dataset.claim, { method: "POST", body: tell({}) });
      if (answer.ok && !answer.redirected) {
        const claim = await answer.json();
        words.textContent = claim.taken;
        form.dataset.until = claim.until;
      }
    } catch {
      return; // the service is away for a moment
    }
    taken.hidden = !words.textContent;
  }
  window.addEventListener("pageshow", hold);
  document.addEventListener("visibilitychange", hold);
  setInterval(hold, HOLD_MS);
  window.addEventListener("pagehide", () => {
    // the claim of this page only: the next page may renew it before this message arrives
    const release = form.dataset.until;
    if (release && !sent) navigator.sendBeacon(form.dataset.claim, tell({ release }));
  });

  // ---- pointer
  input.addEventListener("pointerup", () => {
    if (input.selectionEnd - input.selectionStart <= 1) choose(input.selectionStart);
  });
  input.addEventListener("scroll", () => { cells.scrollLeft = input.scrollLeft; });
  document.addEventListener("pointerover", (event) => {
    const over = event.target.closest?.("[data-place]");
    light("hover", over ? Number(over.dataset.place) : null);
  });
  document.addEventListener("click", (event) => {
    const node = event.target.closest?.("[data-place]");
    if (!node) return;
    const place = Number(node.dataset.place);
    const button = event.target.closest(".candidate");
    if (button) pick(place, [...button.parentElement.querySelectorAll(".candidate")].indexOf(button));
    else if (owners.includes(place)) choose(owners.indexOf(place));
  });

  // ---- begin at the first place in doubt
  function first() {
    const k = doubts.findIndex((d) => d);
    return k < 0 ? 0 : k;
  }
  choose(first(), Boolean(who.value.trim()));
  if (!who.value.trim()) who.focus();
  input.addEventListener("focus", () => setTimeout(() => {
    if (document.activeElement === input && input.selectionEnd - input.selectionStart !== 1) choose(at);
  }));
})();
