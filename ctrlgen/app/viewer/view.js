"use strict";
// A page with work that goes on is read again every few seconds; what was chosen and opened on it stays so.
(() => {
  const main = document.getElementById("main");
  const seconds = Number(main.dataset.again);
  if (!seconds) return;
  const again = async () => {
    if (document.hidden || main.contains(document.activeElement)) return;
    try {
      const answer = await fetch(location.href);
      const found = new DOMParser().parseFromString(await answer.text(), "text/html").getElementById("main");
      const chosen = new Set([...main.querySelectorAll("input:checked")].map((box) => box.value));
      for (const box of found.querySelectorAll("input[type=checkbox]")) if (chosen.has(box.value)) box.setAttribute("checked", "");
      if (found.innerHTML !== main.innerHTML) main.replaceChildren(...found.childNodes);
      if (!found.dataset.again) clearInterval(timer);
    } catch {
      clearInterval(timer); // the program was ended
    }
  };
  const timer = setInterval(again, 1000 * seconds);
})();
